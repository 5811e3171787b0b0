"""draw_rays and read_pixels."""

import pytest
import torch
from op_checks import generator
from splitnerf.ops.rays import EdgeRuns, PixelList, draw_rays, read_pixels

CPU = torch.device("cpu")
CAMERAS = torch.eye(3).repeat(2, 1, 1), torch.tensor([[0.0, 0.0, 0.0], [7.0, 8.0, 9.0]])
EVERY = PixelList.all(2 * 4 * 5, CPU)  # two photos of 4 rows and 5 columns
RUNS = PixelList(torch.tensor([2, 3, 7]), torch.tensor([1, 5, 30]), 7)  # pixels 1 2, 7, 33 34 35 36


def drawn(random: list[float], n_near: int, near: PixelList = RUNS, known: PixelList = EVERY):
    return draw_rays(torch.tensor(random), n_near, near, known, *CAMERAS, 4, 5)


def test_a_list_is_shared_out_among_its_rays():
    """Seven rays to seven listed pixels, each its own; two rays to forty pixels: one in each half, at 0.5 and 0.99 of it."""
    _, _, view, index = drawn([0.0, 0.3, 0.6, 0.9, 0.1, 0.0, 0.999, 0.5, 0.99], 7)
    assert index.tolist() == [1, 2, 7, 33, 34, 35, 36, 10, 39]
    assert view.tolist() == [0, 0, 0, 1, 1, 1, 1, 0, 1]


def test_every_pixel_is_drawn_as_often():
    random = torch.rand(50, 35, generator=generator())
    index = torch.cat([drawn(row.tolist(), 0, known=EVERY)[3] for row in random])
    counts = index.bincount(minlength=40)
    assert counts.min() > 25 and counts.max() < 65 and counts.sum() == 50 * 35


def test_rays_begin_at_their_views_centre_and_go_through_the_middles_of_pixels():
    rays_o, rays_d, view, index = drawn([0.5] * 40, 0)
    assert torch.equal(rays_o, CAMERAS[1][view])
    row, column = index % 20 // 5, index % 5
    expected = torch.stack([column + 0.5, row + 0.5, torch.ones(40)], 1)
    torch.testing.assert_close(rays_d, expected / expected.norm(dim=1, keepdim=True))


def test_a_direction_is_the_matrix_times_the_point():
    matrices = torch.randn(2, 3, 3, generator=generator(), dtype=torch.float64)
    _, rays_d, _, index = draw_rays(
        torch.tensor([0.1, 0.7], dtype=torch.float64), 0, EVERY, EVERY, matrices, CAMERAS[1].double(), 4, 5
    )
    for i, view in enumerate((0, 1)):
        point = torch.tensor([index[i] % 5 + 0.5, index[i] % 20 // 5 + 0.5, 1.0], dtype=torch.float64)
        torch.testing.assert_close(rays_d[i], torch.nn.functional.normalize(matrices[view] @ point, dim=0))


def test_numbers_that_are_out_of_range_stay_within_the_photos():
    """Of a list that names pixels which are not there, and of random numbers that are none."""
    beyond = PixelList(torch.tensor([3]), torch.tensor([1000]), 3)
    assert drawn([0.5, 0.5], 2, near=beyond)[3].tolist() == [39, 39]
    assert drawn([-3.0, 2.0], 0)[3].tolist() == [0, 39] and drawn([-3.0, 2.0], 2)[3].tolist() == [1, 36]


EXPOSURES = torch.tensor([[1.0, 2, 3], [4, 5, 6]])
RANDOM = 0.1 * torch.arange(12.0).view(4, 3)
EDGES = EdgeRuns(
    torch.tensor([2, 6]), torch.tensor([3, 8]), torch.tensor([-2, -5]), torch.arange(9, dtype=torch.uint8).view(3, 3)
)


def read(codes: torch.Tensor, pixels: list[int], edges: EdgeRuns = EDGES):
    """Of two photos of four pixels."""
    index = torch.tensor(pixels, dtype=torch.int64)
    return read_pixels(codes, index, index // 4, EXPOSURES, RANDOM[: len(pixels)], edges)


@pytest.mark.parametrize("dtype", [torch.uint8, torch.int16, torch.float32])
def test_codes_are_read_as_the_values_they_stand_for(dtype):
    """Words are those without a sign, in tensors whose numbers have one."""
    values = torch.linspace(0, 1, 32).view(8, 4)
    most = {torch.uint8: 255, torch.int16: 65535}.get(dtype, 1)
    codes = (values * most).round() if most > 1 else values
    stored = torch.where(codes > 32767, codes - 65536, codes).to(dtype) if dtype == torch.int16 else codes.to(dtype)
    pixels, exposure, _, _ = read(stored, [7, 0, 3, 4])
    torch.testing.assert_close(pixels, codes[[7, 0, 3, 4]] / most)
    assert torch.equal(exposure, EXPOSURES[[1, 0, 0, 1]])


def test_pixels_of_runs_have_a_colour_of_their_own_behind_them():
    """The first and the last of a run too, but not its neighbours, nor a pixel before all runs."""
    for pixels, row in (([2, 6, 7], [0, 1, 2]), ([0, 1, 3, 5], [None] * 4)):
        _, _, behind, whole = read(torch.zeros(8, 4), pixels)
        assert whole.tolist() == [k is not None for k in row]
        for i, k in enumerate(row):
            expected = RANDOM[i] if k is None else EDGES.behind[k] / 255
            torch.testing.assert_close(behind[i], expected)
    assert not read(torch.zeros(8, 4), [2, 6], EdgeRuns.none(CPU))[3].any()
