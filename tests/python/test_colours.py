"""The colours that photos' files state, and that each is brought to sRGB."""

import io
import struct
import zlib

import numpy as np
import OpenImageIO as oiio
import pytest
from blender_data import write_exr
from PIL import Image, ImageCms
from splitnerf import errors
from splitnerf.data import colours
from splitnerf.data.colours import DISPLAY_P3, REC709
from splitnerf.data.images import linear_to_srgb, read_codes, read_colours, read_header, read_radiance, srgb_to_linear
from splitnerf.relight.background import read_plate
from splitnerf_tools.capture.photographs import find_photographs, read_upright


def wide_profile(name: str = "wide") -> bytes:
    """An ICC profile with sRGB's curve, whose red is that of Display P3 (tag values: CSS Color 4, adapted to D50)."""
    srgb = bytearray(ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes())
    columns = {b"rXYZ": (0.5151, 0.2412, -0.0011), b"gXYZ": (0.2920, 0.6922, 0.0419), b"bXYZ": (0.1571, 0.0666, 0.7841)}
    for i in range(struct.unpack(">I", srgb[128:132])[0]):
        tag, offset, size = struct.unpack(">4sII", srgb[132 + 12 * i : 144 + 12 * i])
        if tag in columns:
            srgb[offset + 8 : offset + 20] = struct.pack(">3i", *(round(65536 * x) for x in columns[tag]))
        if tag == b"desc":
            old, new = ("sRGB".encode("utf-16-be"), name.encode("utf-16-be"))
            srgb[offset : offset + size] = srgb[offset : offset + size].replace(old, new)
    return bytes(srgb)


# From linear Display P3 to linear sRGB (CSS Color 4, section 10).
FROM_P3 = np.array([[1.224940, -0.224940, 0], [-0.042057, 1.042057, 0], [-0.019638, -0.078636, 1.098274]])


@pytest.mark.parametrize(("suffix", "name"), [(".png", "wide"), (".jpg", "wide"), (".png", "sRGB")])
def test_a_colour_profile_is_applied_to_photos_alone(tmp_path, capsys, suffix, name):
    photo, path = np.full((16, 16, 3), (180, 130, 90), np.uint8), tmp_path / f"x{suffix}"
    Image.fromarray(photo).save(path, icc_profile=wide_profile(name), quality=100, subsampling=0)
    expected = 255 * linear_to_srgb((FROM_P3 @ srgb_to_linear(np.float32([180, 130, 90]) / 255)).astype(np.float32))
    assert read_colours(path)[3, 3] == pytest.approx(expected, abs=2) and abs(expected[0] - 180) > 8
    assert "are converted to sRGB" in capsys.readouterr().err
    assert read_codes(path)[3, 3] == pytest.approx([180, 130, 90], abs=2)  # a map of numbers
    (photo_of,) = find_photographs(tmp_path)
    assert read_upright(photo_of.path)[3, 3] == pytest.approx(expected, abs=2)
    assert read_plate(path)[3, 3] == pytest.approx(srgb_to_linear(np.float32(expected) / 255), rel=0.06)


def test_a_profile_beside_damaged_exif_is_applied(tmp_path, monkeypatch):
    monkeypatch.setattr(Image.Exif, "get_ifd", {}.__getitem__)  # raises KeyError
    Image.fromarray(np.full((4, 4, 3), (180, 130, 90), np.uint8)).save(tmp_path / "x.png", icc_profile=wide_profile())
    assert read_colours(tmp_path / "x.png")[2, 2, 0] > 185


def grey_profile() -> bytes:
    """An ICC profile of one channel whose curve is a gamma of 1.8."""
    curve = struct.pack(">4s4xIH2x", b"curv", 1, round(1.8 * 256))
    white = struct.pack(">4s4x3i", b"XYZ ", *(round(65536 * x) for x in (0.9642, 1.0, 0.8249)))
    texts = [struct.pack(">4s4xI4s80x", b"desc", 5, b"grey"), struct.pack(">4s4x4s4x", b"text", b"none")]
    body, table = b"", b""
    for tag, data in zip((b"kTRC", b"wtpt", b"desc", b"cprt"), (curve, white, *texts)):
        table += struct.pack(">4sII", tag, 132 + 12 * 4 + len(body), len(data))
        body += data
    size = 132 + len(table) + len(body)
    head = struct.pack(">I4xI4s4s4s12x4s", size, 0x02200000, b"mntr", b"GRAY", b"XYZ ", b"acsp")
    illuminant = struct.pack(">3i", *(round(65536 * x) for x in (0.9642, 1.0, 0.8249)))
    return head.ljust(68, b"\0") + illuminant + bytes(48) + struct.pack(">I", 4) + table + body


def write_words(path, pixels: np.ndarray, profile: bytes) -> None:
    """A PNG of 16 bits with an ICC profile."""
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], "uint16")
    spec.attribute("ICCProfile", oiio.TypeDesc(f"uint8[{len(profile)}]"), np.frombuffer(profile, np.uint8))
    sink = oiio.ImageOutput.create("x.png")
    assert sink.open(str(path), spec) and sink.write_image(pixels) and sink.close()


def test_a_profile_that_is_srgb_changes_nothing(tmp_path, capsys):
    photo = np.full((4, 4, 3), (180, 130, 90), np.uint8)
    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    Image.fromarray(photo).save(tmp_path / "srgb.png", icc_profile=srgb)
    write_words(tmp_path / "words.png", np.uint16(photo) * 257 + np.uint16(3), srgb)
    assert np.array_equal(read_colours(tmp_path / "srgb.png"), photo)
    assert np.array_equal(read_colours(tmp_path / "words.png"), np.uint16(photo) * 257 + 3)
    assert capsys.readouterr().err == ""


def test_profiles_of_words_and_of_grey_photos_are_applied(tmp_path):
    p3 = linear_to_srgb((FROM_P3 @ srgb_to_linear(np.float32([180, 130, 90]) / 255)).astype(np.float32))
    write_words(tmp_path / "words.png", np.full((4, 4, 3), (180, 130, 90), np.uint16) * np.uint16(257), wide_profile())
    assert read_colours(tmp_path / "words.png")[2, 2] == pytest.approx(65535 * p3, abs=400)
    grey = 255 * linear_to_srgb(np.float32([(90 / 255) ** 1.8]))[0]
    assert abs(grey - 90) > 8
    photo = np.full((4, 4, 1), 90, np.uint8)
    Image.fromarray(photo[..., 0]).save(tmp_path / "grey.png", icc_profile=grey_profile())
    write_words(tmp_path / "grey_words.png", np.uint16(photo) * 257, grey_profile())
    assert read_colours(tmp_path / "grey.png")[2, 2] == pytest.approx([grey], abs=1.5)
    assert read_colours(tmp_path / "grey_words.png")[2, 2] == pytest.approx([257 * grey], abs=400)
    for name, factor in (("grey", 1), ("grey_words", 257)):  # as `prepare` reads it
        assert read_upright(tmp_path / f"{name}.png")[2, 2] == pytest.approx([factor * grey] * 3, abs=1.5 * factor)


def with_chunk(image: Image.Image, kind: bytes, data: bytes) -> bytes:
    """A PNG file with another chunk before its pixels."""
    buffer = io.BytesIO()
    image.save(buffer, "png")
    whole = buffer.getvalue()
    chunk = struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    return whole[:33] + chunk + whole[33:]


@pytest.mark.parametrize("photo", [np.full((4, 4, 3), 90, np.uint8), np.full((4, 4), 90 * 257, np.uint16)])
@pytest.mark.parametrize(("gamma", "exponent"), [(1.0, 1.0), (1 / 1.95, 1.95), (1 / 2.2, None), (1 / 2.5, 2.5)])
def test_a_stated_gamma_is_brought_to_srgb(tmp_path, capsys, photo, gamma, exponent):
    data = with_chunk(Image.fromarray(photo), b"gAMA", struct.pack(">I", round(1e5 * gamma)))
    (tmp_path / "x.png").write_bytes(data)
    share = 90 / 255 if exponent is None else linear_to_srgb(np.float32([(90 / 255) ** exponent]))[0]
    expected = pytest.approx(share * np.iinfo(photo.dtype).max, rel=0.01)
    assert read_colours(tmp_path / "x.png")[0, 0, 0] == expected
    assert ("state the gamma" in capsys.readouterr().err) == (exponent is not None)
    assert read_upright(tmp_path / "x.png")[0, 0, 0] == expected  # as `prepare` reads it


# From linear Adobe RGB to linear sRGB (Adobe RGB (1998) Color Image Encoding, section 4.3; IEC 61966-2-1).
FROM_ADOBE = np.array([[1.3983, -0.3983, 0], [0, 1, 0], [0, -0.0429, 1.0429]])


# From linear Rec. 2020 to linear Rec. 709 (ITU-R BT.2087).
FROM_2020 = np.array([[1.6605, -0.5876, -0.0728], [-0.1246, 1.1329, -0.0083], [-0.0182, -0.1006, 1.1187]])
CODED = {"P3": (12, FROM_P3), "Rec. 2020": (9, FROM_2020)}


@pytest.mark.parametrize("stated", ["EXIF", "cHRM", *CODED])
def test_stated_primaries_are_brought_to_srgb(tmp_path, capsys, monkeypatch, stated):
    """Adobe RGB as cameras state it and as a PNG's chunks do; others by their codes. In strips of three rows."""
    monkeypatch.setattr(colours, "ROWS", 3)
    colour, image = np.float32([180, 100, 60]), Image.fromarray(np.full((4, 4, 3), (180, 100, 60), np.uint8))
    path = tmp_path / ("x.jpg" if stated == "EXIF" else "x.png")
    if stated == "EXIF":
        exif = Image.Exif()
        exif.get_ifd(34665)[40961] = 65535
        exif.get_ifd(34665)[40965] = {1: "R03"}
        image.save(path, exif=exif, quality=100, subsampling=0)
    elif stated == "cHRM":
        chunk = struct.pack(">8I", 31270, 32900, 64000, 33000, 21000, 71000, 15000, 6000)
        path.write_bytes(with_chunk(image, b"cHRM", chunk))
    else:
        path.write_bytes(with_chunk(image, b"cICP", bytes((CODED[stated][0], 13, 0, 1))))
    light = (colour / 255) ** 2.2 if stated == "EXIF" else srgb_to_linear(colour / 255)
    light = CODED.get(stated, (0, FROM_ADOBE))[1] @ light
    expected = 255 * linear_to_srgb(light.astype(np.float32))
    assert abs(expected - colour).max() > 8
    for read in (read_colours, read_upright):
        assert read(path) == pytest.approx(np.tile(expected, (4, 4, 1)), abs=2)
    assert "primaries that are not sRGB's; they are brought to sRGB" in capsys.readouterr().err


def test_primaries_of_an_exr_are_brought_to_srgb(tmp_path, capsys):
    light, paths = np.float32([2.0, 0.5, 0.25]), []
    for name, primaries in (("srgb", REC709), ("p3", DISPLAY_P3)):
        paths.append(write_exr(tmp_path / f"{name}.exr", np.tile(light, (4, 4, 1)), primaries=primaries))
    assert read_radiance(paths[0])[1, 1].tolist() == light.tolist() and not capsys.readouterr().err
    assert read_radiance(paths[1])[1, 1] == pytest.approx(FROM_P3 @ light, abs=2e-3)
    green = write_exr(tmp_path / "green.exr", np.tile(np.float32([0, 1, 0]), (4, 4, 1)), primaries=DISPLAY_P3)
    assert read_radiance(green)[1, 1] == pytest.approx(np.maximum(FROM_P3[:, 1], 0), abs=2e-3)  # outside of sRGB
    assert "primaries that are not sRGB's; they are brought to sRGB's (p3.exr)" in capsys.readouterr().err


def ultra_hdr(pixels: np.ndarray) -> bytes:
    """A JPEG with a gain map of 4 behind it (Ultra HDR image format 1.0), as phones write them."""

    def jpeg(image: np.ndarray, said: str) -> bytes:
        data = io.BytesIO()
        Image.fromarray(image).save(data, "jpeg", quality=95)
        space = 'xmlns:hdrgm="http://ns.adobe.com/hdr-gain-map/1.0/" hdrgm:Version="1.0"'
        xmp = f'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="" {space} {said}</rdf:RDF></x:xmpmeta>'
        app1 = b"http://ns.adobe.com/xap/1.0/\0" + xmp.encode()
        return b"\xff\xd8\xff\xe1" + struct.pack(">H", len(app1) + 2) + app1 + data.getvalue()[2:]

    gains = 'hdrgm:GainMapMin="0" hdrgm:GainMapMax="2" hdrgm:Gamma="1" hdrgm:OffsetSDR="0.015625" hdrgm:OffsetHDR="0.015625" hdrgm:HDRCapacityMin="0" hdrgm:HDRCapacityMax="2" hdrgm:BaseRenditionIsHDR="False"/>'
    gain_map = jpeg(np.full((16, 16), 255, np.uint8), gains)
    items = [f'Item:Semantic="{what}" Item:Mime="image/jpeg"' for what in ("Primary", "GainMap")]
    items[1] += f' Item:Length="{len(gain_map)}"'
    listed = "".join(f'<rdf:li rdf:parseType="Resource"><Container:Item {item}/></rdf:li>' for item in items)
    google = "http://ns.google.com/photos/1.0/container/"
    said = f'xmlns:Container="{google}" xmlns:Item="{google}item/"><Container:Directory><rdf:Seq>{listed}</rdf:Seq></Container:Directory></rdf:Description>'
    return jpeg(pixels, said) + gain_map


def test_the_gain_map_of_a_phone_is_not_applied(tmp_path, capsys):
    (tmp_path / "x.jpg").write_bytes(ultra_hdr(np.full((64, 64, 3), 128, np.uint8)))
    assert read_header(tmp_path / "x.jpg").bits == 8
    assert (read_colours(tmp_path / "x.jpg") == 128).all() and (read_upright(tmp_path / "x.jpg") == 128).all()
    assert "the gain maps of photos are not used (x.jpg)" in capsys.readouterr().err


def test_an_unknown_colour_space_and_an_alpha_are_said(tmp_path, capsys):
    """As cameras name none; a curve for bright screens; of cut-outs; a gamma with a wrong checksum, which Pillow refuses."""
    exif = Image.Exif()
    exif.get_ifd(34665)[40961] = 65535
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(tmp_path / "x.jpg", exif=exif)
    (tmp_path / "x.png").write_bytes(with_chunk(Image.new("RGB", (4, 4)), b"cICP", bytes((9, 16, 0, 1))))
    for file, read in (("x.jpg", read_colours), ("x.jpg", read_upright), ("x.png", read_colours)):
        errors._said.clear()
        read(tmp_path / file)
        assert "state that their colours are not sRGB, and not what they are" in capsys.readouterr().err
    no_light = struct.pack(">8I", 31270, 32900, 64000, 0, 64000, 0, 15000, 6000)
    (tmp_path / "z.png").write_bytes(with_chunk(Image.fromarray(np.full((4, 4, 3), 9, np.uint8)), b"cHRM", no_light))
    assert (read_colours(tmp_path / "z.png") == 9).all() and "primaries that are none" in capsys.readouterr().err
    Image.fromarray(np.zeros((4, 4, 4), np.uint8)).save(tmp_path / "y.png")
    read_upright(tmp_path / "y.png")
    assert "the alpha of photos is not used; give --masks if it is the object's (y.png)" in capsys.readouterr().err
    data = bytearray(with_chunk(Image.fromarray(np.full((4, 4, 3), 9, np.uint8)), b"gAMA", struct.pack(">I", 100000)))
    data[data.index(b"gAMA") + 8] ^= 255
    (tmp_path / "d.png").write_bytes(data)
    assert (read_colours(tmp_path / "d.png") == 9).all()
    assert "what photos state of their colours cannot be read; they count as sRGB (d.png)" in capsys.readouterr().err
