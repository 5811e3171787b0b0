"""A NeRF: a hash grid and two small networks learn density and colour from images with known cameras.

nerf.py [DATA] [--steps N] [--rays N] [--out FILE]; DATA is any layout that `splitnerf train` reads (default: the
demo's scene, which is rendered first). Prints the PSNR of held-out views and writes them as a PNG: images above,
renderings below.
"""

import argparse
import tempfile

import numpy as np
import torch
from splitnerf.data.dataset import load_dataset
from splitnerf.data.images import write_image
from splitnerf.ops import HashGridSpec, composite, hash_encode, march_rays
from splitnerf.ops.rays import PackedSamples
from splitnerf.render.rays import image_rays
from splitnerf_tools.demo.scene import write_demo_dataset
from torch import nn

BOX, STEP, RESOLUTION = 1.5, 0.025, 48  # load_dataset brings the object into the box [-BOX, BOX]^3
SPEC = HashGridSpec(n_levels=10, base_resolution=12, growth=1.4, log2_table_size=15)
AXIS = (torch.arange(RESOLUTION) + 0.5) / RESOLUTION * 2 * BOX - BOX
CENTRES = torch.stack(torch.meshgrid(AXIS, AXIS, AXIS, indexing="ij"), dim=-1).view(-1, 3)


def density_weights(density: torch.Tensor, samples: PackedSamples) -> tuple[torch.Tensor, torch.Tensor]:
    """The samples' weights, with alpha = 1 - exp(-density length), and each ray's opacity."""
    depth = density * (samples.t_ends - samples.t_starts)
    total = torch.cat([depth.new_zeros(1), depth]).double().cumsum(0)  # up to each sample, over all rays
    before = (total[:-1] - total[samples.offsets[samples.ray_indices]]).to(depth)
    weights = torch.exp(-before) * -torch.expm1(-depth)
    return weights, composite(weights, torch.ones_like(weights)[:, None], samples.offsets)[:, 0]


class NeRF(nn.Module):
    def __init__(self):
        super().__init__()
        self.table = nn.Parameter(torch.empty(SPEC.n_entries, SPEC.n_features).uniform_(-1e-4, 1e-4))
        self.body = nn.Sequential(nn.Linear(SPEC.n_outputs, 64), nn.ReLU(), nn.Linear(64, 16))
        self.head = nn.Sequential(nn.Linear(16 + 9, 64), nn.ReLU(), nn.Linear(64, 3), nn.Sigmoid())
        self.cells = torch.ones((RESOLUTION,) * 3, dtype=torch.uint8)  # 1: may hold something, 0: empty
        self.largest = torch.zeros(RESOLUTION**3)  # density of each cell, a maximum that fades

    def features(self, x):
        return self.body(hash_encode(x / (2 * BOX) + 0.5, self.table, SPEC))

    def density(self, features):
        return torch.exp(features[:, 0].clamp(max=9))

    @torch.no_grad()
    def find_empty_cells(self):
        x = CENTRES + (torch.rand_like(CENTRES) - 0.5) * (2 * BOX / RESOLUTION)
        self.largest = torch.maximum(0.9 * self.largest, self.density(self.features(x)))
        self.cells = (self.largest > 0.5).view_as(self.cells).to(torch.uint8)

    def forward(self, rays_o, rays_d, background, jitter):
        samples = march_rays(rays_o, rays_d, jitter, self.cells, box=BOX, step=STEP)
        d = rays_d[samples.ray_indices]
        features = self.features(rays_o[samples.ray_indices] + d * samples.middles[:, None])
        colour = self.head(torch.cat([features, d, d * d, d * d.roll(1, dims=1)], dim=1))
        weights, opacity = density_weights(self.density(features), samples)
        return composite(weights, colour, samples.offsets) + (1 - opacity[:, None]) * background


def all_rays(data):
    """Origins, directions [n, 3] and colours with alpha [n, 4] of all pixels of a data set."""
    poses, intrinsics = torch.tensor(data.poses), torch.tensor(data.intrinsics)
    rays = [image_rays(p, k, data.height, data.width) for p, k in zip(poses, intrinsics)]
    pixels = torch.cat([torch.tensor(data.images[i]).view(-1, 4) for i in range(len(data))])
    return *(torch.cat(x) for x in zip(*rays)), pixels


def train(data, steps, n_rays):
    model = NeRF()
    optimiser = torch.optim.Adam(model.parameters(), lr=1e-2, eps=1e-15)
    schedule = torch.optim.lr_scheduler.ExponentialLR(optimiser, 0.05 ** (1 / steps))
    rays_o, rays_d, pixels = all_rays(data)
    for step in range(steps):
        if step % 32 == 0 and step > 0:
            model.find_empty_cells()
        i = torch.randint(len(pixels), (n_rays,))
        background, alpha = torch.rand(n_rays, 3), pixels[i, 3:]
        truth = pixels[i, :3] * alpha + background * (1 - alpha)
        loss = (model(rays_o[i], rays_d[i], background, torch.rand(n_rays)) - truth).square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
    return model


@torch.no_grad()
def test(model, data, path):
    rays_o, rays_d, pixels = all_rays(data)
    truth = pixels[:, :3] * pixels[:, 3:] + 1 - pixels[:, 3:]
    middle = torch.full((len(truth),), 0.5)
    parts = zip(rays_o.split(8192), rays_d.split(8192), middle.split(8192))
    image = torch.cat([model(o, d, torch.ones(3), jitter) for o, d, jitter in parts])
    views = torch.stack([truth, image]).view(2, len(data), data.height, data.width, 3)
    error = (views[0] - views[1]).square().mean(dim=(1, 2, 3))
    write_image(path, np.vstack([np.hstack(list(row)) for row in views[:, :4].clamp(0, 1).numpy()]))
    print(f"{len(data)} held-out views: {(-10 * error.log10()).mean():.2f} dB; wrote {path}")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("data", nargs="?")
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--rays", type=int, default=1024, help="of a step")
    parser.add_argument("--out", default="nerf.png")
    arguments = parser.parse_args()
    torch.manual_seed(0)
    with tempfile.TemporaryDirectory() as folder:
        data = arguments.data or write_demo_dataset(folder)
        model = train(load_dataset(data, "train"), arguments.steps, arguments.rays)
        test(model, load_dataset(data, "test"), arguments.out)


if __name__ == "__main__":
    main()
