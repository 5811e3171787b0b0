"""The learned functions of space and direction: SDF, materials, occlusion factors and light."""

from splitnerf.fields.heads import MaterialHead, OcclusionHead
from splitnerf.fields.light import Light
from splitnerf.fields.light_mlp import LightMlp
from splitnerf.fields.light_pyramid import LightPyramid
from splitnerf.fields.sdf import SdfField

__all__ = ["Light", "LightMlp", "LightPyramid", "MaterialHead", "OcclusionHead", "SdfField"]
