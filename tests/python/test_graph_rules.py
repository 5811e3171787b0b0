"""When a step is recorded, repeated, or taken without a graph, and what goes into a graph and comes out of it."""

import functools
import gc
from contextlib import contextmanager, nullcontext
from types import SimpleNamespace
from typing import NamedTuple

import pretend_graphs
import pytest
import torch
from pretend_gpu import Stream, pretend_gpu
from splitnerf.data.dataset import load_dataset
from splitnerf.render.model import SceneModel
from splitnerf.training import gpu_step
from splitnerf.training import loop as trainer
from splitnerf.training.batches import PixelSource, draw_batch
from splitnerf.training.gpu_step import GpuStep, in_units
from splitnerf.training.meshes import SurfaceMesh
from splitnerf.training.step import Capacity, Step, StepNumbers
from tiny_runs import lines_of, tiny, train_scene
from torch import Tensor

LIGHT_PERIOD = 4
PRIORS_FROM = 0.5
PADDED = 1280  # 1.15 times the target of 1000, in units of 256
COUNTS = (1000.0, 300.0)  # shaded samples and segments
ROOM = (1280, 512)  # 1.25 times as many, in units of 256
LOOKUP = torch.tensor([[0.0, 0.6, 0.8], [0.6, 0.0, 0.8]]), torch.tensor([[0.3], [0.7]])


class Rays(NamedTuple):
    target: Tensor


class Found(NamedTuple):
    directions: Tensor
    number: Tensor


class Fake(GpuStep):
    """Finds what it is told, and takes the gradient of something simple of each of a step's inputs."""

    def __init__(self, model: SceneModel):
        mesh = SimpleNamespace(made_at=0.0)
        super().__init__(model, None, mesh, torch.Generator().manual_seed(0))
        self.calls: list[tuple[int, int] | None] = []
        self.n_found, self.scale = PADDED, 1.0
        self.given: tuple[Rays, Found] | None = None  # the inputs of the last step

    def find(self, batch: Rays, progress: float, capacity: int) -> Found:
        assert capacity in (0, PADDED)
        found = Found(torch.full((capacity or self.n_found, 3), self.scale), torch.tensor([int(7 * self.scale)]))
        self.given = batch, found
        return found

    def differentiate(self, batch, found, light, step, progress, capacity):
        self.calls.append(capacity)
        self.model.zero_grad(set_to_none=True)
        looked_up = light(*LOOKUP).sum() + (light.cells.radiance * light.cells.solid_angles[:, None]).mean()
        value = (
            batch.target.sum() * found.directions.mean() * self.model.variance
            + batch.target.mean() * found.number.sum() * looked_up
        )
        value.backward()
        return value.detach(), {"value": value.detach()}

    def counted(self, *counts: float) -> bool:
        """Reads the counts of the last step; returns whether it was complete."""
        self.last = StepNumbers(1, 5, {}, {}, 0.0, Capacity(self.n_found, *counts), 20.0, 0.0)
        return self.capacity.holds(self.last.counts)

    def taken(self, n_rays=5, step=0, progress=0.0, counts: tuple | None = COUNTS, light=None, target=1.0):
        """One step and its counts; returns what it gave, how it was taken, and whether it was complete."""
        before, known = len(self.calls), list(self._graphs.values())
        light = self.model.evaluate_light() if light is None else light
        result = self.gradients(Rays(torch.full((n_rays, 3), target)), light, step, progress)
        is_new = any(all(graph is not other for other in known) for graph in self._graphs.values())
        how = "recorded" if is_new else "called" if len(self.calls) > before else "repeated"
        complete = self.counted(*counts) if counts else None
        return SimpleNamespace(value=result[0].item(), how=how, capacity=self.calls[-1], complete=complete)


@pytest.fixture
def step(monkeypatch) -> Fake:
    pools = pretend_graphs.Pools()
    monkeypatch.setattr(gpu_step, "record", functools.partial(pretend_graphs.record, pools=pools))
    monkeypatch.setattr(torch.cuda, "Stream", Stream)
    monkeypatch.setattr(torch.cuda, "graph_pool_handle", pools.handle)
    torch.manual_seed(0)
    config = tiny(
        target_samples=1000,
        light_step_every=LIGHT_PERIOD,
        priors_from=PRIORS_FROM,
        **{"shading.method": "summed"},
        table_dtype="float16",
        steps=100,
        cuda_graphs=True,
    )
    return Fake(SceneModel(config))


def ways(taker: Fake, n: int, **settings) -> list[str]:
    """How n steps were taken."""
    return [taker.taken(**settings).how for _ in range(n)]


# ---- when ----


def test_a_step_is_called_and_then_recorded_and_then_repeated(step, monkeypatch):
    """The first fits all there is; the first with a capacity is called too, so that its kernels are loaded."""
    assert step.sample_capacity == PADDED
    replays, replay = [], pretend_graphs.PretendGraph.replay
    monkeypatch.setattr(pretend_graphs.PretendGraph, "replay", lambda self: replays.append(self) or replay(self))
    assert ways(step, 5) == ["called", "called", "recorded", "repeated", "repeated"]
    assert step.calls == [None, ROOM, ROOM] and len(replays) == 3 and replays[0] is replays[1] is replays[2]
    assert ways(step, 3, n_rays=6) == ["called", "recorded", "repeated"] and step.calls[3:] == [ROOM, ROOM]
    assert ways(step, 1) == ["repeated"]


def test_steps_without_a_least_weight_have_a_capacity_where_they_are_recorded(step):
    step.model.config = step.model.config.replace({"sampling.min_weight": 0.0})
    assert ways(step, 4) == ["called", "called", "recorded", "repeated"] and step.calls == [None, ROOM, ROOM]


def test_without_counts_of_a_step_before_none_is_recorded(step):
    assert ways(step, 4, counts=None) == ["called"] * 4 and step.calls == [None] * 4


def test_samples_without_room_are_not_complete_and_the_next_step_has_no_limit(step):
    """Until the samples of a step fit again, into the graph that there was."""
    ways(step, 3)
    step.n_found = PADDED + 1
    cut = step.taken()
    assert cut.how == "repeated" and cut.complete is False
    assert ways(step, 3) == ["called"] * 3 and step.calls[-3:] == [None] * 3
    step.n_found = PADDED
    assert ways(step, 3) == ["called", "repeated", "repeated"] and step.calls[-1] is None


def decide(step: Fake, what: str) -> dict:
    """Changes one of the host's decisions."""
    if what == "levels":
        step.model.sdf_field.grid.n_active -= 1
    elif what == "mesh":
        step.mesh.made_at = 0.25
    elif what == "occlusion":
        step.model.has_mesh = True
    elif what == "held":
        step.is_held = lambda progress: True
    settings = {"light": {"step": LIGHT_PERIOD - 1}, "priors": {"progress": PRIORS_FROM}, "rays": {"n_rays": 6}}
    return settings.get(what, {})


@pytest.mark.parametrize("what", ["levels", "mesh", "occlusion", "held", "light", "priors", "rays"])
def test_another_decision_is_another_graph(step, what):
    ways(step, 4)
    settings = decide(step, what)
    assert ways(step, 3, **settings) == ["called", "recorded", "repeated"]


def test_steps_that_decide_alike_share_a_graph(step):
    """The light moves with the 4th, the 8th and the last step, for which it stands for 4, 4 and one steps."""
    ways(step, 3)
    for k, progress in ((1, 0.1), (2, 0.3), (6, PRIORS_FROM - 0.01)):
        assert step.taken(step=k, progress=progress).how == "repeated"
    assert [step.taken(step=3).how for _ in range(2)] == ["called", "recorded"]
    assert step.taken(step=7).how == step.taken(step=95).how == "repeated"
    assert step.taken(step=99).how == "repeated" and step.taken(step=98).how == "repeated"
    step.model.config = step.model.config.replace({"steps": 98})
    assert step.taken(step=97).how == "called"  # for 2 steps


def test_a_graph_with_too_little_room_is_recorded_anew_before_it_fails(step):
    """While a tenth more than the last counts still fits it stays: 1.1 * 1163 = 1279.3, 1.1 * 465 = 511.5."""
    ways(step, 3)
    for counts in ((1163.0, 100.0), (100.0, 465.0), COUNTS):
        assert step.taken(counts=counts).complete
    assert ways(step, 1) == ["repeated"]
    for counts, capacity in (((1164.0, 100.0), (1536, 256)), ((100.0, 466.0), (256, 768))):
        assert step.taken(counts=counts).how == "repeated"
        assert step.taken().how == "recorded" and step.calls[-1] == capacity
        ways(step, 1, counts=COUNTS)


@pytest.mark.parametrize("counts", [(1281.0, 512.0), (1280.0, 513.0)])
def test_what_exceeds_its_room_is_not_complete_and_one_graph_is_recorded_anew(step, counts):
    """With more capacity: that of the key, although no other is left. Others stay as they are."""
    assert step.taken(counts=(1e9, 1e9)).complete  # the first step has no limit
    step.counted(*COUNTS)
    ways(step, 2)
    assert step.taken(counts=(1280.0, 512.0)).complete is True
    step.counted(*COUNTS)
    assert ways(step, 2, n_rays=6) == ["called", "recorded"]
    assert step.taken(counts=counts).complete is False and len(step._graphs) == 2
    step.counted(*COUNTS)
    assert ways(step, 2) == ["repeated"] * 2 and ways(step, 1, n_rays=6) == ["repeated"]
    assert step.taken(counts=counts).complete is False
    again = step.taken()
    assert again.how == "recorded" and again.complete and step.calls[-1] == tuple(in_units(1.25 * n) for n in counts)
    assert ways(step, 1, n_rays=6) == ["repeated"]


def test_a_pool_whose_graphs_are_all_gone_is_not_recorded_into(step):
    """As torch would refuse it."""
    ways(step, 3)
    first = step._pool
    assert ways(step, 3, n_rays=6) == ["called", "recorded", "repeated"] and step._pool == first
    step._graphs.clear()
    assert ways(step, 1) == ["recorded"] and step._pool != first
    # the only one, anew
    assert step.taken(counts=(1164.0, 300.0)).complete and ways(step, 2) == ["recorded", "repeated"]


def test_four_graphs_are_kept_and_the_oldest_makes_room(step):
    for n_rays in range(5, 9):
        ways(step, 4, n_rays=n_rays)
    assert [step.taken(n_rays=n).how for n in range(5, 9)] == ["repeated"] * 4
    ways(step, 2, n_rays=9)
    assert [step.taken(n_rays=n).how for n in (6, 7, 8, 9, 5, 7)] == ["repeated"] * 4 + ["recorded", "repeated"]
    assert len(step._graphs) == 4


# ---- what ----


def gradients(step: Fake) -> list[Tensor | None]:
    return [None if p.grad is None else p.grad.clone() for p in step.model.parameters()]


def test_a_repeated_step_is_that_of_its_own_inputs(step):
    """Rays, samples, light and its cells; gradients are at the parameters and at the light given, where they add up."""
    ways(step, 4)
    model = step.model
    for k in range(1, 4):
        with torch.no_grad():
            model.light.texels.add_(0.1 * k * torch.randn_like(model.light.texels))
            model.variance.add_(0.1)
        step.scale = 1.0 + k
        light, again = model.evaluate_light(), model.evaluate_light()
        for number in (1, 2):
            repeated = step.taken(light=light, target=0.3 * k + number)
            assert repeated.how == "repeated"
            found, own = gradients(step), model.variance.grad
            called = step.differentiate(*step.given, again, 0, 0.0, None)
            assert repeated.value == pytest.approx(called[0].item(), rel=1e-6)
            for a, b in zip(found, gradients(step), strict=True):
                assert (a is None and b is None) or torch.equal(a, b)
            for a, b in zip(light.leaves, again.leaves, strict=True):
                torch.testing.assert_close(a.grad, b.grad)
                assert a.grad.abs().sum() > 0
        assert own is not model.variance.grad


def test_a_graph_leaves_its_callers_tensors_alone(step):
    """Those that it was recorded with: other steps' numbers go into memory of its own."""
    ways(step, 2)
    light, other = step.model.evaluate_light(), step.model.evaluate_light()
    assert step.taken(light=light).how == "recorded"
    tensors = [*step.given[0], *step.given[1], *light.leaves]
    before = [x.detach().clone() for x in tensors]
    step.scale = 3.0
    changed = other.with_leaves([2.0 * x.detach() for x in other.leaves])
    assert step.taken(light=changed, target=5.0).how == "repeated"
    assert all(torch.equal(a, b) for a, b in zip(tensors, before, strict=True))


def test_the_copy_of_16_bits_is_made_outside_of_a_graph(step):
    """In the memory that a graph reads, where it is stale when a step begins: the step itself does not ask for it."""
    ways(step, 4)
    grid = step.model.sdf_field.grid
    copy = grid.stored()
    with torch.no_grad():
        grid.table.add_(1.0)
    assert ways(step, 1) == ["repeated"] and torch.equal(copy, grid.table.detach().half())


def test_a_capacity_comes_in_units_and_holds_all_or_not():
    assert [in_units(n) for n in (0, 1, 256, 256.9, 257, 1150)] == [0, 256, 256, 256, 512, 1280]
    capacity = Capacity(5, 10, 20)
    assert capacity.holds(Capacity(5, 10, 20)) and capacity.holds(Capacity(0, 0, 0))
    assert Capacity().holds(Capacity(1e9, 1e9, 1e9))
    assert not any(capacity.holds(more) for more in (Capacity(6, 10, 20), Capacity(5, 11, 20), Capacity(5, 10, 21)))
    assert Capacity(5.5, 11, 22).holds(capacity, slack=1.1)
    assert not Capacity(5.5, 11, 22).holds(Capacity(5, 10, 20.1), slack=1.1)
    assert Capacity().of_shading is None and capacity.of_shading == (10, 20)


# ---- the recording itself ----


@pytest.mark.parametrize("collects", [True, False])
@pytest.mark.parametrize("fails", [(), ("begin",), ("work",), ("work", "end")])
def test_nothing_is_collected_while_recording_and_its_first_error_is_told(monkeypatch, fails, collects):
    """A recording that has begun ends, once."""
    events = []

    def happens(name, *details):
        events.append((name, *details, gc.isenabled()))
        if name in fails:
            raise RuntimeError(name)
        return "result"

    class Graph:
        register_generator_state = staticmethod(lambda generator: events.append(generator))
        capture_begin = staticmethod(lambda **settings: happens("begin", settings))
        capture_end = staticmethod(lambda: happens("end"))

    monkeypatch.setattr(torch.cuda, "CUDAGraph", Graph)
    was_on = gc.isenabled()
    try:
        (gc.enable if collects else gc.disable)()
        with pytest.raises(RuntimeError, match=fails[0]) if fails else nullcontext():
            graph, result = gpu_step.record(lambda: happens("work"), "pool", "generator")
            assert isinstance(graph, Graph) and result == "result"
        assert gc.isenabled() == collects
    finally:
        (gc.enable if was_on else gc.disable)()
    begun = "generator", ("begin", {"pool": "pool", "capture_error_mode": "thread_local"}, False)
    assert events == [*begun, *([] if "begin" in fails else [("work", False)]), ("end", False)]


@pytest.mark.parametrize("fails", [False, True])
def test_work_waits_for_what_came_before_and_what_comes_after_for_it(step, monkeypatch, fails):
    events = []

    def stream(name):
        return SimpleNamespace(name=name, wait_stream=lambda other: events.append(f"{name} waits for {other.name}"))

    @contextmanager
    def within(stream):
        events.append(f"in {stream.name}")
        try:
            yield
        finally:
            events.append(f"out of {stream.name}")

    step._stream = stream("ours")
    monkeypatch.setattr(torch.cuda, "current_stream", lambda device: stream("theirs"))
    monkeypatch.setattr(torch.cuda, "stream", within)
    with pytest.raises(ValueError) if fails else nullcontext(), step.running():
        events.append("work")
        if fails:
            raise ValueError
    assert events == ["ours waits for theirs", "in ours", "work", "out of ours", "theirs waits for ours"]


@pytest.fixture
def recording(monkeypatch):
    """Graphs on the CPU; counts how they were used."""
    return pretend_graphs.graphs_on_the_cpu(monkeypatch)


def called(function, pool, generator):
    """In place of `record`: the replay calls the function."""
    outputs = [None, None]
    return SimpleNamespace(replay=lambda: outputs.__setitem__(slice(None), function())), outputs


def same_lines(folder) -> None:
    """The runs `recorded` and `called` have the same numbers but for their seconds."""
    for ours, theirs in zip(lines_of(folder / "recorded"), lines_of(folder / "called"), strict=True):
        assert ours | {"seconds": 0} == theirs | {"seconds": 0}


class Taken(NamedTuple):
    """How a step was taken, its rays, and what there was after it: kinds of steps, steps without capacity, and the progress at the
    mesh in use."""

    how: str
    n_rays: int
    n_kinds: int
    skipped: int
    made_at: float


def schedule_of_a_gpu(data, run, monkeypatch, used, **settings) -> tuple[trainer.Training, list[Taken]]:
    """The schedule of preset fast in 160 steps on a pretended GPU. Before step 57 the surface becomes so blurred that rays find a half
    more samples. Memory that a mesh leaves when the next comes is overwritten."""
    advance, poll, use = trainer.Training.advance, SurfaceMesh.poll, SceneModel.use_mesh
    steps = []

    def watched(training, bar):
        if training.step == 57:
            training.model.variance.data.sub_(0.1)
        before, taken = used.copy(), training.take_step
        advance(training, bar)
        how = next(way for way in ("recorded", "called", "replayed") if used[way] > before[way])
        n_rays = len(taken.newest[0].target)
        steps.append(Taken(how, n_rays, len(taken._with_kernels), taken.skipped, training.mesh.made_at))

    def leaving(model, bits):
        old = model.bits
        use(model, bits)
        for x in () if old is None or model.bits is old else (old.cache.vertices, old.cache.normals):
            x.fill_(torch.nan)

    with monkeypatch.context() as patch:
        patch.setattr(trainer.Training, "advance", watched)
        # which step takes it is no chance
        patch.setattr(SurfaceMesh, "poll", lambda mesh, wait=False: poll(mesh, wait=True))
        patch.setattr(SceneModel, "use_mesh", leaving)
        surface = {"target_samples": 4608, "open_below": 0.0, "start_levels": 1, "indirect_every": 25}
        seldom = {"preview_every": 1.0, "checkpoint_minutes": 1e3}
        config = tiny("fast", steps=160, cuda_graphs=True, **surface, **seldom, **settings)
        run.mkdir()
        with pretend_gpu(patch):
            return train_scene(load_dataset(data), config, run, device="cuda"), steps


def test_a_whole_schedule_runs_through_graphs_to_its_end(data, tmp_path, monkeypatch, recording):
    """Numbers are read late; levels open, meshes are swapped, priors begin, the light moves. When the surface blurs, a step and
    the one on its way find more samples than their capacity: they move nothing, and the next has no limit. Called in place of
    recorded it gives the same bits."""
    trained, steps = schedule_of_a_gpu(data, tmp_path / "recorded", monkeypatch, recording)
    assert trained.finished and all(p.isfinite().all() for p in trained.model.parameters())
    # the first step that read of one that was not complete
    at = next(i for i, step in enumerate(steps) if step.skipped)
    assert 57 < at <= 57 + gpu_step.READ_EVERY and [step.how for step in steps[at : at + 2]] == ["recorded", "called"]
    assert [steps[i].skipped for i in (at - 1, at, at + 1, 159)] == [0, 1, 2, 2]
    assert len({step.made_at for step in steps}) == 10 and len(steps) == 160
    rays = [step.n_rays for step in steps]
    # none goes to and fro
    assert not any(a == c != b for a, b, c in zip(rays, rays[1:], rays[2:])) and len(set(rays[80:])) <= 3
    # A kind of steps is called, then recorded, and recorded anew where the graph has too little capacity.
    assert recording["recorded"] <= steps[-1].n_kinds and recording["called"] <= steps[-1].n_kinds + 15
    assert [step.how for step in steps].count("replayed") > 70

    monkeypatch.setattr(gpu_step, "record", called)
    other, _ = schedule_of_a_gpu(data, tmp_path / "called", monkeypatch, recording)
    for a, b in zip(trained.model.parameters(), other.model.parameters(), strict=True):
        assert torch.equal(a, b)
    same_lines(tmp_path)


def test_a_capacity_changes_roundings_alone(data):
    """Losses and gradients of one step with capacity for more of everything, against those with none."""
    dataset = load_dataset(data)
    weights = {"eikonal_weight": 0.0, "entropy_weight": 0.0, "shape_priors_until": 1.0}
    config = tiny("cpu", open_below=0.0, n_levels=6, target_samples=3000, initial_variance=0.4, **weights)
    model = SceneModel(config)
    generator = torch.Generator().manual_seed(0)
    source = PixelSource(dataset, 0.85, generator)
    mesh = SurfaceMesh(model)
    mesh.request(0.5)
    grid = SimpleNamespace(cells=torch.ones(16, 16, 16, dtype=torch.uint8))
    take_step = Step(model, grid, mesh, generator)
    batch = draw_batch(source, 200, config, torch.ones(len(dataset), 3))
    found = take_step.find(batch, 0.9)
    n = len(found.directions)
    padded_found = take_step.find(batch, 0.9, n + 77)
    assert n > 500 and len(padded_found.directions) == n + 77 and model.sums_light

    def step(found, capacity):
        take_step.generator = torch.Generator().manual_seed(1)
        light = model.evaluate_light()
        ray, terms = take_step.differentiate(batch, found, light, 3, 0.9, capacity)
        light.backward()
        return {k: t.value.detach() for k, t in terms.items()}, [p.grad for p in model.parameters()], ray

    terms, grads, ray = step(found, None)
    padded_terms, padded_grads, padded = step(padded_found, (4096, 2048))
    assert padded.sizes.tolist() == ray.sizes.tolist() and len(padded.shaded) == 4096
    assert {"colour", "neutral", "smoothness", "mask", "dark_metal"} <= set(terms)
    for name, value in terms.items():
        if name != "eikonal":  # it looks at some points twice, and counts for nothing here
            torch.testing.assert_close(padded_terms[name], value, rtol=1e-5, atol=1e-7)
    for (name, _), a, b in zip(model.named_parameters(), padded_grads, grads, strict=True):
        assert (a - b).norm() <= 1e-4 * b.norm(), name


def test_waiting_while_recording_is_refused():
    """Else no test of this file would find any."""
    for waits in (lambda x: x.sum().item(), lambda x: x.nonzero(), lambda x: x[x > 0]):
        with pytest.raises(RuntimeError, match="waits"):
            pretend_graphs.record(lambda: waits(torch.ones(3)), None, torch.Generator())
