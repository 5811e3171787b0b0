"""Pre-integrates a linear light over GGX lobes and compares the result with closed forms.

For L(w) = 1 + k.w the lobe of roughness 1 is a cosine, so gbar(n, 1) = 1 + (2/3) k.n exactly; for any roughness
gbar = 1 + c(rho) k.n with one number c, which a one-dimensional integral gives.
"""

import torch
from splitnerf.ops import fibonacci_directions, prefilter_light


def mean_cosine(roughness: float, n: int = 200000) -> float:
    """c(rho) = int D c^2 dc / int D c dc, D = a^2 / (a^2 + (1 - a^2)(1 - c)/2)^2, c = w.n in [0, 1]."""
    a2 = roughness**4
    cosine = 1 - ((torch.arange(n, dtype=torch.float64) + 0.5) / n) ** 4  # crowded at the lobe's centre
    width = (1 - cosine) ** 0.75
    lobe = width / (a2 + (1 - a2) * (1 - cosine) / 2) ** 2
    return ((lobe * cosine**2).sum() / (lobe * cosine).sum()).item()


def main() -> None:
    k = torch.tensor([0.3, -0.2, 0.5])
    generator = torch.Generator().manual_seed(0)
    queries = fibonacci_directions(500, generator)
    for roughness in (0.2, 0.3, 0.5, 0.7, 1.0):
        exact = 1 + mean_cosine(roughness) * (queries @ k)[:, None].expand(-1, 3)
        errors = {}
        for name in ("rotated lattice", "independent"):
            lights = fibonacci_directions(8192, generator)
            if name == "independent":
                lights = torch.nn.functional.normalize(torch.randn(8192, 3, generator=generator), dim=1)
            light = (1 + lights @ k)[:, None].expand(-1, 3)
            gbar = prefilter_light(queries, torch.full((500, 1), roughness), light_dirs=lights, light=light)
            errors[name] = ((gbar - exact).square().mean() / exact.square().mean()).sqrt().item()
        print(f"roughness {roughness}: " + ", ".join(f"{name} {100 * e:.4f} %" for name, e in errors.items()))


if __name__ == "__main__":
    main()
