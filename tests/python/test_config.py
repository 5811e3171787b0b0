"""Settings: what each is by default and in the presets, what it may be, and by which names it is known."""

import dataclasses
import math
import re

import pytest
from hypothesis import HealthCheck, assume, given
from hypothesis import settings as examples
from hypothesis import strategies as st
from splitnerf.cli import DONE, main
from splitnerf.config import FIELDS, GROUPS, SHORT_NAMES, Config, parse_setting, preset, settings_table
from splitnerf.config.setting import setting
from splitnerf.config.settings import tomllib
from splitnerf.errors import InputError
from splitnerf.training.checkpoint import config_of


def flat(groups: dict[str, dict]) -> dict[str, object]:
    return {f"{group}.{key}": value for group, table in groups.items() for key, value in table.items()}


def values(config: Config) -> dict[str, object]:
    return flat(dataclasses.asdict(config))


def check_same(found: dict[str, object], expected: dict[str, object]) -> None:
    assert found == expected
    assert {name: type(value) for name, value in found.items()} == {name: type(v) for name, v in expected.items()}


# What the paper prints (section 4 and its supplement), and what its released code adds.
PRINTED = dict(
    run=dict(steps=20000),
    surface=dict(n_levels=16, growth=1.3195079, log2_table_size=19, start="sphere"),
    materials=dict(inputs="outputs"),
    light=dict(kind="mlp"),
    shading=dict(method="split", fresnel="paper", query="reflection", compensate=False, compositing="srgb"),
    occlusion=dict(kind="mlp", channels=1, indirect=False),
    mesh=dict(every=0.1),
    losses=dict(colour_weight=10.0, light_weight=10.0, occlusion_weight=0.01, eikonal_weight=0.1, metal_weight=0.001),
    constants=dict(surface_width=64, materials_width=256, light_width=256, light_layers=5, occlusion_width=256)
    | dict(direction_frequencies=10, light_samples=8129, warmup_steps=500),
)
RELEASED = dict(
    surface=dict(normals="finite_difference"),
    sampling=dict(occupancy="average", max_rays=8192, target_samples=262144, grid_resolution=128),
    mesh=dict(resolution=512),
    constants=dict(min_step=math.sqrt(3) * 3 / 1024, light_queries=8129, learning_rate=0.01, final_learning_rate=0.1)
    | dict(box=1.5, sphere_radius=0.5, initial_variance=0.3, initial_rays=256, occlusion_rays=64)
    | dict(start_levels=4, levels_open_by=0.6),  # 12 levels, one each 1000 of 20,000 steps
)


def test_preset_paper_holds_the_numbers_of_the_paper():
    found, expected = values(preset("paper")), flat(PRINTED) | flat(RELEASED)
    check_same({name: found[name] for name in expected}, expected)
    check_same(values(preset("cpu")), values(Config()))
    with pytest.raises(InputError, match="unknown preset 'gpu'; there are cpu, fast, paper"):
        preset("gpu")


@pytest.mark.parametrize("name", FIELDS)
def test_every_setting_is_described(name):
    known = FIELDS[name]
    assert set(known.metadata) == {"meaning", "unit", "limits"}
    meaning = known.metadata["meaning"]
    assert len(meaning) > 8 or name.startswith("constants.")
    assert not meaning.endswith(".") and "\n" not in meaning
    assert known.type == type(known.default).__name__ and known.metadata["limits"].allow(known.default)
    assert known.metadata["unit"] == "" or known.type in ("int", "float")


def test_a_bound_that_is_excluded_is_the_one_that_is_named():
    limits = setting(1.0, "ratio of two lengths", above=0.5, at_most=2).metadata["limits"]
    assert str(limits) == "in (0.5, 2]" and [limits.allow(x) for x in (0.25, 0.5, 0.75, 2.0, 2.25)] == [0, 0, 1, 1, 0]


def test_every_group_says_what_it_holds():
    for kind in GROUPS.values():
        assert kind.__doc__.strip() and not kind.__doc__.startswith(kind.__name__ + "(")


def test_short_names_are_those_that_one_group_alone_has():
    config = preset("paper")
    for name, value in values(config).items():
        group, key = name.split(".")
        same = [other for other in FIELDS if other.endswith(f".{key}")]
        short = [f"{group}_{key}", *([key] if same == [name] or group == "run" else [])]
        assert [other for other, of in SHORT_NAMES.items() if of == name] == short
        for other in (name, *short):
            assert config[other] == value
            split = {"shading.method": "split"}  # goes with all others
            assert Config().replace({other: value} | split) == Config().replace({name: value} | split)
    assert not SHORT_NAMES.keys() & GROUPS.keys() and "share" not in SHORT_NAMES and SHORT_NAMES["steps"] == "run.steps"


def test_settings_change_by_name_by_short_one_and_by_group():
    new = {"light_resolution": 64, "losses.eikonal_weight": 2.0, "export": {"faces": 7, "resolution": 9}}
    changed = Config().replace(new)
    expected = {"light.resolution": 64, "losses.eikonal_weight": 2.0, "export.faces": 7, "export.resolution": 9}
    check_same(values(changed), values(Config()) | expected)
    assert Config().light.resolution == 128
    # The last one counts, whatever it is called by.
    assert Config().replace({"n_levels": 5, "surface": {"n_levels": 6}}).surface.n_levels == 6
    assert Config().replace({"surface": {"n_levels": 6}, "n_levels": 5}).surface.n_levels == 5
    assert Config().replace({}) == Config()
    # What was changed before stays, in the same group and in others.
    again = preset("paper").replace({"surface.n_levels": 5})
    check_same(values(again), values(preset("paper")) | {"surface.n_levels": 5})


def test_settings_cannot_change_in_place():
    config = Config()
    firsts = ((getattr(config, group), dataclasses.fields(kind)[0].name) for group, kind in GROUPS.items())
    for owner, name in ((config, "run"), *firsts):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(owner, name, 1)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"surface.n_levls": 4}, "unknown setting 'surface.n_levls'; did you mean surface.n_levels? "),
        ({"surface_widht": 4}, "unknown setting 'surface_widht'; did you mean constants.surface_width? "),
        ({"export": {"face": 4}}, "unknown setting 'export.face'; did you mean export.faces? "),
        ({"zzz": 4}, "unknown setting 'zzz'; `splitnerf info --settings` lists them"),
        ({3: 4}, "unknown setting 3; "),
        ({"losses": 4}, "losses is a group of settings; set one of them, such as losses.colour_weight"),
        ({"surface.n_levels": "many"}, "surface.n_levels takes a value of type int, got 'many'"),
        ({"n_levels": 4.0}, "surface.n_levels takes a value of type int, got 4.0"),
        ({"n_levels": True}, "surface.n_levels takes a value of type int, got True"),
        ({"indirect": 1}, "occlusion.indirect takes a value of type bool, got 1"),
        ({"light": {"resolution": {"x": 1}}}, "light.resolution takes a value of type int, got {'x': 1}"),
        ({"losses.seen_weight": math.nan}, "losses.seen_weight must be in [0, 1e+30], got nan"),
        ({"losses.seen_weight": 10**40}, "losses.seen_weight must be in [0, 1e+30], got 1000"),
        ({"box": 0}, "constants.box must be in [0.001, 1024], got 0.0"),
        ({"min_transmittance": 1}, "constants.min_transmittance must be in [0, 1), got 1.0"),
        ({"light.kind": "mlp", "light_samples": 0}, "constants.light_samples must be in [1, 16777216], got 0"),
        ({"preview_every": 0.0}, "run.preview_every must be in (0, 1e+30], got 0.0"),
        ({"growth": 16.0, "n_levels": 32}, "a level of the hash grid needs fewer than 1073741824 cells"),
        ({"export.faces": 16777217}, "export.faces must be in [0, 16777216], got 16777217"),
        ({"light.kind": "cube"}, "light.kind must be one of mlp, pyramid, got 'cube'"),
        ({"light.resolution": 48}, "light.resolution must be one of 16, 32, 64, 128, 256, 512, 1024, got 48"),
        ({"constants.occlusion_directions": 250}, "constants.occlusion_directions must be one of 64, 96, 128, "),
        ({"occlusion.kind": "off"}, "shading.method = summed needs"),
        ({"shading.compositing": "srgb"}, "shading.method = summed needs"),
        ({"shading.fresnel": "paper"}, "shading.method = summed needs"),
        (
            {"constants.occlusion_directions": 224},
            "shading.method = summed needs occlusion.kind = bits with at least 256 constants.occlusion_directions",
        ),
        ({"run.deterministic": True, "run.max_minutes": 1.0}, "a deterministic run ends by its steps alone; "),
        ({"run.cuda_graphs": True, "light.kind": "mlp"}, "run.cuda_graphs needs"),
        ({"run.cuda_graphs": True, "surface.normals": "finite_difference"}, "run.cuda_graphs needs"),
        ({"run.cuda_graphs": True, "constants.entropy_points": 1}, "run.cuda_graphs needs"),
        ({"run.cuda_graphs": True, "shading.method": "split", "occlusion.kind": "mlp"}, "run.cuda_graphs needs"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(settings, message):
    with pytest.raises(InputError, match=re.escape(message)) as caught:
        Config().replace(settings)
    assert str(caught.value).startswith(message) and len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    "settings",
    [
        {"run.cuda_graphs": True, "shading.method": "split", "occlusion.kind": "off"},
        {"shading.method": "split", "constants.occlusion_directions": 64, "shading.fresnel": "paper"},
    ],
)
def test_what_can_be_is_taken(settings):
    assert {name: Config().replace(settings)[name] for name in settings} == settings


def test_a_group_is_no_word():
    with pytest.raises(InputError, match="light is a group of settings, got 'cube'"):
        Config(light="cube")


def setting_values(name: str) -> st.SearchStrategy:
    """All values of a setting, but for rules that join several."""
    known, limits = FIELDS[name], FIELDS[name].metadata["limits"]
    if limits.choices:
        return st.sampled_from(limits.choices)
    if known.type == "bool":
        return st.booleans()
    if known.type == "str":
        return st.text(st.characters(exclude_categories=("Cs",)), max_size=8)
    if known.type == "float":
        return st.floats(limits.low, limits.high, exclude_min=limits.without_low, exclude_max=limits.without_high)
    return st.integers(limits.low, limits.high)


@examples(max_examples=50, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.fixed_dictionaries({}, optional={name: setting_values(name) for name in FIELDS}))
def test_all_settings_survive_their_file_and_their_checkpoint(tmp_path_factory, settings):
    try:
        config = Config().replace(settings)
    except InputError as error:
        assert " needs " in str(error) or "deterministic run" in str(error)  # by rules that join settings alone
        assume(False)
    path = tmp_path_factory.getbasetemp() / "settings.toml"
    config.write(path)
    for again in (Config.read(path), config_of({"config": dataclasses.asdict(config)})):
        assert again == config
        check_same(values(again), values(config))


def test_the_file_has_a_table_for_each_group(tmp_path):
    path = tmp_path / "config.toml"
    preset("paper").write(path)
    table = tomllib.loads(path.read_text())
    assert list(table) == list(GROUPS) and table["surface"]["n_levels"] == 16
    assert table["constants"]["light_width"] == 256
    path.write_text('seed = 3\nlight_kind = "mlp"\nlight_width = 32\n')
    assert Config.read(path) == Config().replace({"run.seed": 3, "light.kind": "mlp", "constants.light_width": 32})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("steps = [", "not a readable run configuration"),
        (b"\xff", "not a readable run configuration"),
        (f"steps = {'1' * 5000}", "not a readable run configuration"),
        ("[surface]\nn_levels = 0", "surface.n_levels must be in"),
        ("[nothing]\nn = 0", "unknown setting 'nothing'"),
    ],
)
def test_files_that_hold_no_settings_are_named(tmp_path, text, message):
    path = tmp_path / "config.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError, match=f"config.toml: {message}"):
        Config.read(path)
    with pytest.raises(InputError, match="nowhere.toml: not a readable"):
        Config.read(tmp_path / "nowhere.toml")


def test_settings_as_they_are_typed():
    typed = {
        "n_levels=4": ("surface.n_levels", 4),
        "surface.n_levels = 4": ("surface.n_levels", 4),
        "box=2.5": ("constants.box", 2.5),
        "light.kind=mlp": ("light.kind", "mlp"),
        'light.kind="mlp"': ("light.kind", "mlp"),
        "indirect=false": ("occlusion.indirect", False),
        "light={kind='mlp'}": ("light", {"kind": "mlp"}),
        "no_such=1": ("no_such", 1),
        "query=": ("shading.query", ""),
        f"n_levels={'1' * 5000}": ("surface.n_levels", "1" * 5000),  # more digits than Python makes a number of
    }
    for text, expected in typed.items():
        name, value = parse_setting(text)
        assert (name, value) == expected and type(value) is type(expected[1]), text
    # A name and its short one are one setting, so that of two the last counts.
    assert dict(map(parse_setting, ["surface.n_levels=4", "n_levels=5"])) == {"surface.n_levels": 5}
    for text, message in (("n_levels", "takes key=value"), ("=4", "takes key=value"), ('n_levels="\n', "cannot read")):
        with pytest.raises(InputError, match=message):
            parse_setting(text)


def test_the_table_lists_every_setting_under_its_group(capsys):
    assert main(["info", "--settings", "paper"]) == DONE
    text = capsys.readouterr().out
    assert text.strip() == settings_table(preset("paper"))
    titles = [(group, kind.__doc__.splitlines()[0]) for group, kind in GROUPS.items() if group != "constants"]
    assert re.findall(r"^\[(\w+)\] (.+)$", text, re.M) == titles
    lines = [line for line in text.splitlines() if line and not line.startswith("[")]
    assert [line.split(" = ")[0] for line in lines] == [name for name in FIELDS if not name.startswith("constants.")]
    assert "run.steps = 20000 " in text and "shading.compensate = false " in text and " one of mlp, bits, off " in text
    starts = {line.index(FIELDS[line.split(" = ")[0]].metadata["meaning"]) for line in lines}
    assert len(starts) == 1
    for line in lines:
        name, value = line.split("  ")[0].strip().split(" = ")
        known = FIELDS[name].metadata
        assert value == str(preset("paper")[name]).lower()
        columns = f"{name} = {value}", str(known["limits"]).removeprefix("in "), known["unit"], known["meaning"]
        assert re.split(" {2,}", line) == [column for column in columns if column]


def test_a_whole_number_is_one_of_a_float():
    """As `--set initial_variance=10` gives it; a float that is none otherwise stays away from torch."""
    config = Config().replace({"initial_variance": 10, "losses": {"colour_weight": 3}})
    check_same(values(config), values(Config()) | {"constants.initial_variance": 10.0, "losses.colour_weight": 3.0})
