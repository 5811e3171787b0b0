"""The learned functions of space and direction: SDF, materials, occlusion factors and light."""

from splitnerf.fields.light import EvaluatedLight, Light, LightMlp, LightPyramid
from splitnerf.fields.occlusion import Occlusion, SkyCells, VisibilityBits
from splitnerf.fields.surface import MaterialHead, OcclusionHead, SdfField
