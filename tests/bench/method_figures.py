"""The figures of docs/method.md, drawn with the operators themselves.

python tests/bench/method_figures.py [--out docs/figures]        (make figures)

method_neus.png        distance, opacity and weights of samples along a ray, for two sharpnesses
method_levels.png      what a hash grid can hold while its levels open
method_light.png       the pre-integrated light of the demo's sky, by roughness
method_lobe.png        the lobe of a rough metal, its mirror direction and its mean direction
method_occlusion.png   occlusion factors on a plane below a ball, and the closed form
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import splitnerf.ops as ops
import torch
import trimesh
from splitnerf.data.environment import directions_of_texels
from splitnerf_tools.demo.scene import build_environment

GOLD, BLUE, GREY = "#c77c11", "#1f5fa8", "#777777"


def neus() -> plt.Figure:
    """A ray that meets a surface at t = 1, leaves a thin part at 1.3, and meets another surface at 2."""
    edges = torch.linspace(0, 3, 181, dtype=torch.float64)
    distance = torch.minimum((edges - 1.15).abs() - 0.15, 2.0 - edges)
    figure, (top, *axes) = plt.subplots(3, 1, figsize=(7, 5.2), sharex=True, height_ratios=[1, 1, 1])
    top.plot(edges, distance, color="black")
    top.axhline(0, color=GREY, linewidth=0.8)
    top.set_ylabel("distance f")
    offsets = torch.tensor([0, len(edges) - 1])
    middles = (edges[:-1] + edges[1:]) / 2
    for axis, s in zip(axes, (10.0, 60.0)):
        sharp = torch.tensor(s, dtype=torch.float64)
        pair = distance[:-1].contiguous(), distance[1:].contiguous()
        weights, opacity = weights_between(*pair, sharp, offsets)
        alpha = 1 - torch.exp(-depth(*pair, s))
        axis.plot(middles, alpha, color=BLUE, label="opacity of a sample")
        axis.fill_between(middles, weights, color=GOLD, alpha=0.7, label=f"weight (sum {opacity.item():.3f})")
        axis.set_ylabel(f"s = {s:g}")
        axis.legend(loc="upper left", frameon=False)
    axes[-1].set_xlabel("t along the ray")
    return figure


def weights_between(
    f_prev: torch.Tensor, f_next: torch.Tensor, s: torch.Tensor, offsets: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor]:
    """Weights and opacities from the distances at both ends, by samples of a length that no fall of the distance exceeds."""
    step = float((f_next - f_prev).abs().max())
    along = ((f_next - f_prev) / step).clamp(-1, 1)
    gradient = torch.stack([torch.sqrt(1 - along**2), torch.zeros_like(along), along], 1)
    rays_d = torch.tensor([[0.0, 0.0, 1.0]]).to(gradient).expand(len(offsets) - 1, 3)
    return ops.surface_weights((f_prev + f_next) / 2, gradient, rays_d, s, offsets, step=step)[1:]


def depth(f_prev: torch.Tensor, f_next: torch.Tensor, s: float) -> torch.Tensor:
    """The optical depth of each sample, from the opacity of a ray that consists of this sample alone."""
    alone = torch.arange(len(f_prev) + 1)
    _, opacity = weights_between(f_prev, f_next, torch.tensor(s, dtype=f_prev.dtype), alone)
    return -torch.log1p(-opacity)


def levels(size: int = 160) -> plt.Figure:
    """A painted slice of the unit cube, and the best that 2, 4, 6 and 8 open levels make of it."""
    torch.manual_seed(0)
    ticks = (torch.arange(size) + 0.5) / size
    y, x = torch.meshgrid(ticks, ticks, indexing="ij")
    radius = ((x - 0.5) ** 2 + (y - 0.5) ** 2).sqrt()
    rings = 0.5 + 0.5 * torch.sign(torch.sin(60 * radius**2 * 4))
    target = torch.where(radius < 0.45, rings * (0.4 + 0.6 * x), torch.full_like(x, 0.15))
    points = torch.stack([x, y, torch.full_like(x, 0.5)], -1).reshape(-1, 3)
    counts = (2, 4, 6, 8)
    figure, axes = plt.subplots(1, 1 + len(counts), figsize=(10, 2.4))
    for axis, count in zip(axes[1:], counts):
        grid = ops.HashGrid(
            ops.HashGridSpec(n_levels=8, n_features=2, base_resolution=4, growth=1.7, log2_table_size=15)
        )
        grid.n_active = count
        linear = torch.nn.Linear(16, 1)
        optimiser = torch.optim.Adam([*grid.parameters(), *linear.parameters()], lr=0.02)
        for _ in range(250):
            optimiser.zero_grad()
            loss = (linear(grid(points))[:, 0] - target.reshape(-1)).square().mean()
            loss.backward()
            optimiser.step()
        axis.imshow(linear(grid(points)).detach().reshape(size, size), cmap="gray", vmin=0, vmax=1)
        axis.set_title(f"{count} levels: {grid.spec.levels()[count - 1][0]} cells", fontsize=10)
    axes[0].imshow(target, cmap="gray", vmin=0, vmax=1)
    axes[0].set_title("target", fontsize=10)
    for axis in axes:
        axis.set_axis_off()
    return figure


def light(height: int = 48) -> plt.Figure:
    """g(w, rho) of the demo's sky as panoramas."""
    sky = torch.from_numpy(build_environment(96)).double()
    around, areas = (
        torch.from_numpy(x.copy()).reshape(len(sky) * 2 * len(sky), -1) for x in directions_of_texels(len(sky))
    )
    asked = torch.from_numpy(directions_of_texels(height)[0]).reshape(-1, 3)
    values = (0.1, 0.3, 0.6, 1.0)
    figure, axes = plt.subplots(1, 1 + len(values), figsize=(12, 1.6))
    shown = [("rho = 0", sky.numpy())]
    for rho in values:
        rough = torch.full((len(asked), 1), rho, dtype=torch.float64)
        # The texels are not spread evenly: each counts by its solid angle.
        weighted, plain = (
            ops.prefilter_light(asked, rough, light_dirs=around, light=x)
            for x in (sky.reshape(-1, 3) * areas, areas.expand(-1, 3))
        )
        shown.append((f"rho = {rho:g}", (weighted / plain).reshape(height, 2 * height, 3).numpy()))
    for axis, (title, picture) in zip(axes, shown):
        axis.imshow(ops.linear_to_srgb(torch.from_numpy(np.clip(picture, 0, 1))).numpy())
        axis.set_title(title, fontsize=10)
        axis.set_axis_off()
    return figure


def lobe() -> plt.Figure:
    """Polar plots of D V (n.l) in the plane of view and normal, seen at 60 degrees."""
    tilt = np.radians(60)
    view = torch.tensor([[-np.sin(tilt), 0.0, np.cos(tilt)]], dtype=torch.float64)
    normal = torch.tensor([[0.0, 0.0, 1.0]], dtype=torch.float64)
    angles = torch.linspace(-np.pi / 2, np.pi / 2, 721, dtype=torch.float64)
    lights = torch.stack([angles.sin(), 0 * angles, angles.cos()], -1)
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.4), subplot_kw={"projection": "polar"})
    for axis, rho in zip(axes, (0.2, 0.5, 0.8)):
        rough = torch.tensor([[rho]], dtype=torch.float64)
        one = [x.expand(len(lights), -1).contiguous() for x in (normal, view, rough)]
        ones = torch.ones(len(lights), 1, dtype=torch.float64)
        values = ops.shading.monte_carlo_light(*one, lights[:, None], ones, ones[..., None].expand(-1, -1, 3)).specular[
            :, 0
        ]
        axis.set_theta_zero_location("N")
        axis.set_theta_direction(-1)
        axis.set_thetalim(-np.pi / 2, np.pi / 2)
        axis.fill(angles, values / values.max(), color=GOLD, alpha=0.6)
        for query, colour, label in (("reflection", GREY, "mirror direction"), ("mean", BLUE, "asked: mean direction")):
            d = ops.light_queries(normal, view, rough, query)[0][0]
            angle = float(torch.atan2(d[0], d[2]))
            axis.plot([angle, angle], [0, 1], color=colour, linewidth=2, label=label)
        axis.plot([-tilt, -tilt], [0, 1], color="black", linestyle=":", label="view")
        axis.set_yticklabels([])
        axis.set_xticks(np.radians([-60, -30, 0, 30, 60]))
        axis.set_title(f"roughness {rho:g}", fontsize=10, y=0.86)
    axes[1].legend(loc="lower center", bbox_to_anchor=(0.5, 0.05), ncol=3, frameon=False)
    return figure


def occlusion(size: int = 96) -> plt.Figure:
    """Factors on a plane, one below the centre of a ball of radius 1/2."""
    ball, height = trimesh.creation.icosphere(subdivisions=5, radius=0.5), 1.0
    scene = ops.MeshScene(ball.vertices + [0, 0, height], ball.faces)
    ticks = torch.linspace(-2, 2, size)
    y, x = torch.meshgrid(ticks, ticks, indexing="ij")
    points = torch.stack([x, y, 0 * x], -1).reshape(-1, 3)
    normals = torch.tensor([0.0, 0.0, 1.0]).expand(len(points), 3)
    lobe_dirs = torch.nn.functional.normalize(torch.tensor([0.8, 0.0, 0.6]), dim=0).expand(len(points), 3)
    rough = torch.full((len(points), 1), 0.4)
    light = {"lobe_dirs": lobe_dirs, "roughness": rough, "environment": torch.ones(8, 16, 3)}
    rays = {"n_diffuse_rays": 512, "n_specular_rays": 512, "offset": 0.0}
    o_d, o_s = ops.occlusion_factors(scene, points, normals, **light, **rays)
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.2), width_ratios=[1, 1, 1.3])
    for axis, factor, title in zip(axes, (o_d, o_s), ("$o_d$, from above", "$o_s$, lobe to the right, roughness 0.4")):
        axis.imshow(factor.reshape(size, size), cmap="gray", vmin=0, vmax=1, extent=(-2, 2, -2, 2))
        axis.add_patch(plt.Circle((0, 0), 0.5, fill=False, color=GOLD))
        axis.set_title(title, fontsize=10)
    line = torch.linspace(-2, 2, 201)
    far = line**2 + height**2
    axes[2].plot(
        line, 1 - 0.25 / far * (height / far.sqrt()), color="black", linewidth=1, label=r"$1 - (r/l)^2 \cos\theta$"
    )
    axes[2].plot(
        ticks, o_d.reshape(size, size)[size // 2], ".", color=BLUE, markersize=4, label="$o_d$, 512 rays a point"
    )
    axes[2].set_xlabel("place on the plane")
    axes[2].legend(loc="upper center", frameon=False, fontsize=8)
    return figure


FIGURES = {"neus": neus, "levels": levels, "light": light, "lobe": lobe, "occlusion": occlusion}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("docs/figures"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    for name, draw in FIGURES.items():
        figure = draw()
        figure.savefig(args.out / f"method_{name}.png", dpi=110, bbox_inches="tight")
        plt.close(figure)


if __name__ == "__main__":
    main()
