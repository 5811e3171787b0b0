"""The lights that the program makes: as bright as they say, named by relight, and each unlike the others."""

import numpy as np
import pytest
from splitnerf.cli import DONE, main
from splitnerf.data.environment import directions_of_texels
from splitnerf.data.images import read_image, write_image
from splitnerf.export.writers import write_glb
from splitnerf.relight.studio import STUDIO_LIGHTS, direction, light_named, studio_light
from splitnerf_tools.view.assets import light_of
from tiny_runs import refused


@pytest.mark.parametrize("name", STUDIO_LIGHTS)
def test_a_white_matte_surface_that_faces_the_light_is_white(name):
    """The radiance of a white Lambertian surface is irradiance / pi; the largest over all normals is 1."""
    light = studio_light(name)
    assert light.shape == (128, 256, 3) and light.dtype == np.float32 and light.min() >= 0
    directions, areas = directions_of_texels(128)
    flux = (light.mean(axis=2) * areas).ravel()
    normals = directions_of_texels(12)[0].reshape(-1, 3)
    radiance = [np.clip(directions.reshape(-1, 3) @ normal, 0, None) @ flux / np.pi for normal in normals]
    assert max(radiance) == pytest.approx(1, abs=0.02)


def test_the_sunny_lights_sun_stands_at_the_left_behind_the_camera():
    brightest = np.unravel_index(studio_light("sunny").mean(axis=2).argmax(), (128, 256))
    assert directions_of_texels(128)[0][brightest] @ direction(-140, 42) > np.cos(np.radians(1.5))


def test_relight_takes_their_names(ball, tmp_path, capsys):
    write_glb(tmp_path / "ball.glb", ball)
    words = ["relight", str(tmp_path / "ball.glb"), "--size", "24", "--spp", "16"]
    lights = [word for name in STUDIO_LIGHTS for word in ("--env", name)]
    assert main([*words, *lights, "--out", str(tmp_path / "lit")]) == DONE
    pictures = [read_image(tmp_path / "lit" / name / "000.exr")[..., :3] for name in STUDIO_LIGHTS]
    assert min(np.abs(a - b).mean() for i, a in enumerate(pictures) for b in pictures[:i]) > 0.01
    assert f"or {', '.join(STUDIO_LIGHTS)}" in refused(capsys, *words, "--env", "studoi", "--out", tmp_path / "no")
    assert not (tmp_path / "no").exists()
    with pytest.raises(SystemExit):
        main(["relight", "--help"])
    assert ", ".join(STUDIO_LIGHTS) in " ".join(capsys.readouterr().out.split())


def test_a_file_of_that_name_goes_first(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_image(tmp_path / "light.exr", np.full((4, 8, 3), 7.0, np.float32))
    (tmp_path / "light.exr").rename("studio")
    with pytest.raises(Exception, match="use an .exr or .hdr file"):
        light_named("studio")
    assert np.array_equal(light_of("sunset", "x").radiance, studio_light("sunset"))
