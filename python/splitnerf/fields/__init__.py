"""The learned functions of space and direction: SDF, materials, occlusion factors and light."""

from splitnerf.fields.heads import MaterialHead
from splitnerf.fields.light import EvaluatedLight, Light
from splitnerf.fields.light_mlp import LightMlp
from splitnerf.fields.light_pyramid import LightPyramid
from splitnerf.fields.occlusion import (
    NoOcclusion,
    Occlusion,
    OcclusionHead,
    OcclusionModel,
    OcclusionQuery,
    RaySegments,
)
from splitnerf.fields.sdf import SdfField
from splitnerf.fields.visibility import VisibilityBits

__all__ = [
    "EvaluatedLight",
    "Light",
    "LightMlp",
    "LightPyramid",
    "MaterialHead",
    "NoOcclusion",
    "Occlusion",
    "OcclusionHead",
    "OcclusionModel",
    "OcclusionQuery",
    "RaySegments",
    "SdfField",
    "VisibilityBits",
]
