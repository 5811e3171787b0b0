"""Reader of glTF 2.0 files, binary or not."""

from splitnerf.data.gltf.reader import read_asset
