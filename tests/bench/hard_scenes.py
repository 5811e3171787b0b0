"""Assets that are hard to reconstruct, made of formulas: equal bytes every time.

    python tests/bench/hard_scenes.py OUT [--only knot] [--detail 1.0]

    knot    a dark lacquered torus knot, engraved: a glossy dielectric that reflects itself
    rings   rings of metal and enamel, linked: strong interreflection
    basket  a wire lantern with a painted ball in it: thin parts
    helm, casket: see armour.py
    brushed, wheel, porcelain, gilded, wires: see kinds.py

Each becomes OUT/NAME.glb with one material and textures. Data sets are rendered from them with

    splitnerf synth OUT/knot.glb --light lebombo_1k.hdr --relight city.hdr sunset.hdr kloppenheim_05_1k.hdr --out DATA

(rings and casket under christmas_photo_studio_07_1k.hdr, basket and helm under potsdamer_platz_1k.hdr). Every part is a closed surface:
a tube about a curve, whose radius may shrink to 0 at both ends. Parts may stick into each other.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import trimesh
from splitnerf.export.writers import write_glb

sys.path.insert(0, str(Path(__file__).parents[1]))
from bench.armour import ARMOUR  # noqa: E402
from bench.kinds import KINDS  # noqa: E402
from bench.tubes import TAU, Tube, assemble, band, lathe, mix, noise, ring, smooth, through, wire  # noqa: E402


def knot() -> list[Tube]:
    """A (2, 3) torus knot with engraved lozenges; a flower is engraved in each."""
    major, minor, thick = 0.62, 0.28, 0.15

    def on_torus(s, radius):
        u, v = TAU * 2 * s, TAU * 3 * s
        out = major + radius * np.cos(v)
        return np.stack([out * np.cos(u), out * np.sin(u), radius * np.sin(v)], 1)

    def lattice(s, t):
        a, b = 24 * s + 2 * t, 24 * s - 2 * t
        x, y = (np.mod(c, 1) - 0.5 for c in (a, b))
        distance, angle = np.hypot(x, y), np.arctan2(y, x)
        flower = 1 - smooth((distance - 0.18 - 0.09 * np.cos(6 * angle)) / 0.04)
        return np.maximum(band(a, 0.16), band(b, 0.16)), flower, np.mod(np.floor(a) + np.floor(b), 2)

    def paint(s, t):
        groove, flower, odd = lattice(s, t)
        ground = mix((0.030, 0.032, 0.042), (0.046, 0.030, 0.030), odd)
        ground = mix(ground, (0.062, 0.050, 0.036), band(288 * s + 12 * t, 0.35) * (1 - flower))
        colour = mix(mix(ground, (0.080, 0.062, 0.032), flower), (0.034, 0.050, 0.046), groove)
        smudges = noise(s, t, 40, 4, 1)
        return colour, 0.10 + 0.08 * smudges + 0.12 * np.maximum(groove, 0.5 * flower), 0.0

    def radius(s, t):
        groove, flower, _ = lattice(s, t)
        return thick * (1 - 0.10 * groove - 0.05 * flower)

    curve = through(lambda s: on_torus(s, minor), lambda s: on_torus(s, minor) - on_torus(s, 0))
    return [Tube(curve, radius, paint, (1024, 64), 512, 4)]


def rings() -> list[Tube]:
    """A steel ring that carries six others, of metal and of enamel on metal."""
    steel, gold, copper = (0.56, 0.57, 0.58), (0.95, 0.69, 0.30), (0.88, 0.48, 0.35)

    def metal(colour, rough, seed):
        return lambda s, t: (
            mix(np.multiply(colour, 0.85), colour, noise(s, t, 30, 3, seed)),
            rough + 0.12 * noise(s, t, 6, 20, seed + 50),
            1.0,
        )

    def enamel(ground, figure, colour, seed):
        def paint(s, t):
            bars = band(8 * s, 0.12)  # of bare metal
            spots = smooth((np.cos(TAU * (24 * s)) * np.cos(TAU * 3 * t) - 0.25) / 0.15)
            rough = 0.10 + 0.12 * noise(s, t, 12, 4, seed)
            return mix(mix(ground, figure, spots), colour, bars), rough + 0.10 * bars, np.round(bars)

        return paint

    def section(size):
        """A rounded square: |x|^4 + |y|^4 = size^4."""
        return lambda s, t: size / (np.cos(TAU * t) ** 4 + np.sin(TAU * t) ** 4) ** 0.25

    paints = [
        enamel((0.50, 0.03, 0.02), (0.75, 0.62, 0.40), gold, 2),
        metal(gold, 0.12, 3),
        enamel((0.02, 0.12, 0.30), (0.65, 0.70, 0.72), steel, 4),
        metal(copper, 0.22, 5),
        enamel((0.70, 0.66, 0.52), (0.02, 0.22, 0.12), copper, 6),
        metal(steel, 0.10, 7),
    ]
    tubes = [Tube(ring(np.zeros(3), [0, 0, 1], 0.62), section(0.075), metal(steel, 0.15, 8), (256, 40), 256)]
    for i in range(8):
        out, side, up = np.eye(3) @ trimesh.transformations.rotation_matrix(TAU * i / 8, [0, 0, 1])[:3, :3].T
        lean = (-1) ** i * 0.5
        hangs = 0.10 * (out if i % 2 else -up)  # rests on the large ring's tube
        axis = np.cos(lean) * side + np.sin(lean) * (up if i % 2 else out)
        shape = section(0.062) if i % 3 else (lambda s, t: np.full_like(s, 0.075))
        tubes.append(Tube(ring(0.62 * out + hangs, axis, 0.25), shape, paints[i % 6], (128, 40), 256))
    return tubes


def basket() -> list[Tube]:
    """Brass wires and iron hoops on a wooden plate, with a painted ball inside."""
    bulge = lambda z: 0.44 + 0.20 * np.cos(1.6 * z)

    def brass(s, t):
        colour = mix((0.62, 0.44, 0.18), (0.86, 0.66, 0.30), noise(s, t, 20, 2, 11))
        return colour, 0.25 + 0.1 * noise(s, t, 9, 2, 12), 1.0

    def iron(s, t):
        colour = mix((0.03, 0.03, 0.035), (0.10, 0.05, 0.03), noise(s, t, 25, 2, 13))
        return colour, 0.35 + 0.2 * noise(s, t, 9, 2, 14), 0.0

    def wood(s, t):
        grain = np.sin(60 * s + 3 * np.cos(TAU * t) + 2 * noise(s, t, 3, 3, 15))
        return mix((0.20, 0.09, 0.035), (0.38, 0.20, 0.08), 0.5 + 0.5 * grain), 0.45 + 0.15 * noise(s, t, 6, 6, 16), 0.0

    def majolica(s, t):
        leaf = smooth((np.sin(TAU * 6 * t) * np.sin(TAU * 5 * s) - 0.3) / 0.1)
        lines = np.maximum(band(24 * t + 6 * s, 0.18), band(24 * t - 6 * s, 0.18))
        colour = mix((0.72, 0.68, 0.56), (0.02, 0.07, 0.34), lines * (1 - leaf))
        colour = mix(mix(colour, (0.75, 0.33, 0.02), leaf), (0.04, 0.20, 0.06), band(5 * s, 0.15))
        return colour, 0.2 + 0.25 * lines, 0.0

    def rib(turn):
        def path(s):
            z = 1.2 * s - 0.6
            angle = TAU * (turn + 0.12 * s)
            return np.stack([bulge(z) * np.cos(angle), bulge(z) * np.sin(angle), z], 1)

        return through(path, lambda s: path(s) * [1, 1, 0])

    handle = lambda s: np.stack([0.565 * np.cos(np.pi * s), 0 * s, 0.58 + 0.42 * np.sin(np.pi * s)], 1)
    tubes = [Tube(rib(i / 14), wire(0.017), brass, (80, 12), 24) for i in range(14)]
    for z, thick in zip(np.linspace(-0.52, 0.58, 6), (0.016, 0.016, 0.016, 0.016, 0.016, 0.026)):
        around = ring(np.array([0, 0, z]), np.array([0, 0, 1]), float(bulge(z)))
        tubes.append(Tube(around, lambda s, t, r=thick: np.full_like(s, r), iron, (160, 12), 24))
    tubes.append(Tube(through(handle, lambda s: np.tile([0, 1.0, 0], (len(s), 1))), wire(0.022), brass, (96, 12), 32))
    rim = np.linspace(-np.pi / 2, np.pi / 2, 9)
    edge = np.column_stack([0.56 + 0.04 * np.cos(rim), -0.62 + 0.04 * np.sin(rim)])
    inner = np.linspace(0, 0.56, 24)[:-1, None] * [1, 0]
    plate = np.concatenate([inner + [0, -0.66], edge, inner[::-1] + [0, -0.58]])
    tubes.append(Tube(*lathe(plate), wood, (len(plate) - 1, 128), 384))
    polar = np.linspace(0, np.pi, 97)
    ball = np.column_stack([0.37 * np.sin(polar), -0.21 - 0.37 * np.cos(polar)])
    return [*tubes, Tube(*lathe(ball), majolica, (96, 128), 768)]


SCENES = {"knot": knot, "rings": rings, "basket": basket, **ARMOUR, **KINDS}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--only", choices=SCENES, help="one of them")
    parser.add_argument("--detail", type=float, default=1.0, help="factor on the numbers of cells and texels")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    for name in [args.only] if args.only else SCENES:
        asset = assemble(name, SCENES[name](), args.detail)
        write_glb(args.out / f"{name}.glb", asset)
        print(f"{args.out / name}.glb: {len(asset.triangles)} triangles")


if __name__ == "__main__":
    main()
