"""The learned functions of space and direction: SDF, materials, occlusion factors and light."""

from splitnerf.fields.heads import MaterialHead
from splitnerf.fields.light import Light
from splitnerf.fields.light_mlp import LightMlp
from splitnerf.fields.light_pyramid import LightPyramid
from splitnerf.fields.occlusion import Occlusion, OcclusionHead, OcclusionQuery
from splitnerf.fields.sdf import SdfField
from splitnerf.fields.visibility import VisibilityBits

__all__ = [
    "Light", "LightMlp", "LightPyramid", "MaterialHead", "Occlusion", "OcclusionHead", "OcclusionQuery", "SdfField",
    "VisibilityBits",
]  # fmt: skip
