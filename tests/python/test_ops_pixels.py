"""draw_rays out of range; what else it and read_pixels must do is said in stability/properties.py."""

import torch
from splitnerf.ops.rays import PixelList, draw_rays

CPU = torch.device("cpu")
CAMERAS = torch.eye(3).repeat(2, 1, 1), torch.tensor([[0.0, 0.0, 0.0], [7.0, 8.0, 9.0]])
EVERY = PixelList.all(2 * 4 * 5, CPU)  # two photos of 4 rows and 5 columns
RUNS = PixelList(torch.tensor([2, 3, 7]), torch.tensor([1, 5, 30]), 7)  # pixels 1 2, 7, 33 34 35 36


def drawn(random: list[float], n_near: int, near: PixelList = RUNS, known: PixelList = EVERY):
    return draw_rays(torch.tensor(random), n_near, near, known, *CAMERAS, 4, 5)


def test_numbers_that_are_out_of_range_stay_within_the_photos():
    """Of a list that names pixels which are not there, and of random numbers that are none."""
    beyond = PixelList(torch.tensor([3]), torch.tensor([1000]), 3)
    assert drawn([0.5, 0.5], 2, near=beyond)[3].tolist() == [39, 39]
    assert drawn([-3.0, 2.0], 0)[3].tolist() == [0, 39] and drawn([-3.0, 2.0], 2)[3].tolist() == [1, 36]
