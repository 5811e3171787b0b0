"""The learned functions of space and direction: SDF, materials, occlusion factors and light."""

from splitnerf.fields.heads import MaterialHead, OcclusionHead
from splitnerf.fields.light import LightMlp
from splitnerf.fields.sdf import SdfField

__all__ = ["LightMlp", "MaterialHead", "OcclusionHead", "SdfField"]
