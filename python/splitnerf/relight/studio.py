"""Lights that the program makes itself, to look at an asset without a file: soft boxes and skies, by name."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from splitnerf.data.environment import directions_of_texels, read_environment
from splitnerf.data.images import area_average
from splitnerf.errors import InputError

ROWS, COARSE = 128, 32  # of a light, and to find how bright it makes a surface
# (azimuth, elevation) in degrees, azimuth from +x towards +y: the object's front looks to -90. Then the tangents of half the
# width and height, and the colour.
BOXES = {
    "studio": [
        ((-145, 38), (0.5, 0.7), (6.0, 6.0, 6.0)),
        ((-25, 18), (0.35, 0.9), (1.6, 1.6, 1.6)),
        ((80, 50), (0.8, 0.3), (5.0, 5.0, 5.0)),
    ],
    "window": [((-172 + 24 * side, 12 + 27 * up), (0.19, 0.21), (5.0, 5.4, 6.0)) for side in (0, 1) for up in (0, 1)],
}
# Zenith, horizon and ground; then the sun's azimuth and elevation, the width of its glow in degrees, and its colour.
SKIES = {
    "studio": ((0.5, 0.5, 0.5), (0.3, 0.3, 0.3), (0.22, 0.22, 0.22), None),
    "overcast": ((1.0, 1.02, 1.05), (0.36, 0.36, 0.37), (0.16, 0.16, 0.15), None),
    "sunny": ((0.18, 0.32, 0.7), (0.6, 0.68, 0.8), (0.24, 0.22, 0.2), ((-140, 42), 2.5, (320.0, 300.0, 260.0))),
    "sunset": ((0.1, 0.13, 0.3), (0.75, 0.36, 0.22), (0.09, 0.07, 0.07), ((-20, 9), 5.0, (60.0, 24.0, 7.0))),
    "window": ((0.07, 0.07, 0.08), (0.07, 0.065, 0.06), (0.05, 0.045, 0.04), None),
}
STUDIO_LIGHTS = tuple(SKIES)


def is_studio_light(name: str | Path) -> bool:
    """Whether this names a studio light; a file of the same name goes first."""
    return str(name) in STUDIO_LIGHTS and not Path(name).exists()


def light_named(name: str | Path) -> np.ndarray:
    """The light of an .exr or .hdr file, see `read_environment`, or the studio light of this name. Raises InputError if it is
    neither."""
    if is_studio_light(name):
        return studio_light(str(name))
    if not Path(name).is_file():
        raise InputError(f"{name}: no such environment map; give an .exr or .hdr file, or {', '.join(STUDIO_LIGHTS)}")
    return read_environment(name)


def studio_light(name: str) -> np.ndarray:
    """[128, 256, 3] float32 linear radiance of one of `STUDIO_LIGHTS`, in Blender's convention. A white matte surface that faces its
    brightest side has the radiance 1, so that all of them suit the same exposure."""
    directions, areas = directions_of_texels(ROWS)
    zenith, horizon, ground, sun = SKIES[name]
    up = directions[..., 2:]
    sky = np.add(horizon, np.subtract(zenith, horizon) * np.clip(up, 0, 1) ** 0.7)
    radiance = ground + (sky - ground) * smoothstep(-0.06, 0.06, up)
    if sun:
        place, width, colour = sun
        radiance = radiance + np.multiply(
            np.exp((directions @ direction(*place) - 1) / np.radians(width) ** 2)[..., None], colour
        )
    for place, size, colour in BOXES.get(name, ()):
        radiance = radiance + np.multiply(soft_box(directions, direction(*place), *size), colour)
    coarse, solid_angles = directions_of_texels(COARSE)
    coarse, light = coarse.reshape(-1, 3), area_average(radiance.mean(axis=2, keepdims=True), ROWS // COARSE).ravel()
    irradiance = np.clip(coarse @ coarse.T, 0, None) @ (light * solid_angles.ravel())
    return (radiance * (np.pi / irradiance.max())).astype(np.float32)


def direction(azimuth: float, elevation: float) -> np.ndarray:
    """Unit vector from degrees: azimuth from +x towards +y, elevation from the horizon."""
    a, e = np.radians(azimuth), np.radians(elevation)
    return np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])


def smoothstep(low: float, high: float, x: np.ndarray) -> np.ndarray:
    """From 0 at `low` to 1 at `high`, with slopes of 0 there."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def soft_box(directions: np.ndarray, centre: np.ndarray, half_width: float, half_height: float) -> np.ndarray:
    """[..., 1] brightness in [0, 1] of a rectangle with soft edges about a unit direction, its halves as tangents of the angle."""
    right = np.cross([0, 0, 1], centre)
    right /= np.linalg.norm(right)
    ahead = np.maximum(directions @ centre, 1e-6)
    x = np.abs(directions @ right) / ahead / half_width
    y = np.abs(directions @ np.cross(centre, right)) / ahead / half_height
    inside = (1 - smoothstep(0.85, 1.15, x)) * (1 - smoothstep(0.85, 1.15, y))
    return (inside * (directions @ centre > 0.1))[..., None]
