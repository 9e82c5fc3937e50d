"""Depth files and their encodings: to known metres, or to one clear error."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra import numpy as hnp

from fogpipe.errors import InputError
from fogpipe.io.camera import CameraFile
from fogpipe.io.depth import DepthMap, read_depth, to_range
from fogpipe.io.encodings import ENCODINGS, encodings_text

STEREO = CameraFile(
    np.array([[2262.52, 0, 0], [0, 2265.3, 0], [0, 0, 1]]), baseline=0.209313, doffs=31.0, source="camera.json"
)
# Decoding is at most a few roundings in float32.
FLOAT32 = 3e-7


def png(path, codes, bits=16, colour=0):
    """A PNG with the given samples, written out by hand so that no library decides what is stored."""

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    codes = np.asarray(codes)
    rows = b"".join(b"\0" + row.astype(f">u{bits // 8}").tobytes() for row in codes)
    header = struct.pack(">IIBBBBB", codes.shape[1], codes.shape[0], bits, colour, 0, 0, 0)
    palette = chunk(b"PLTE", bytes(range(256)) * 3) if colour == 3 else b""
    content = chunk(b"IHDR", header) + palette + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + content)
    return path


def npy(path, array):
    np.save(path, array)
    return path


def pfm(path, values, order="<", kind="Pf", scale=1.0):
    values = np.asarray(values, f"{order}f4")
    header = f"{kind}\n{values.shape[1]} {values.shape[0]}\n{-scale if order == '<' else scale}\n"
    path.write_bytes(header.encode() + values[::-1].tobytes())
    return path


def exr(path, **channels):
    import OpenEXR

    with OpenEXR.File({}, {name.replace("_", "."): value for name, value in channels.items()}) as file:
        file.write(str(path))
    return path


def refused(path, encoding, camera=None) -> str:
    with pytest.raises(InputError) as caught:
        read_depth(path, encoding=encoding, camera=camera)
    assert str(path) in str(caught.value)
    return str(caught.value)


class TestEncodings:
    """Each encoding, from its codes to metres worked out by hand."""

    @pytest.mark.parametrize(
        ("encoding", "codes", "metres"),
        [
            ("kitti", [0, 256, 1365, 21733], [np.nan, 1.0, 1365 / 256, 21733 / 256]),
            ("millimetres", [0, 955, 2702], [np.nan, 0.955, 2.702]),
            ("tum", [0, 5000, 46655], [np.nan, 1.0, 9.331]),
            # Bits rotated left by 3: 1057 mm fits below the wrap, 9870 mm does not.
            ("sun", [0, 1057 << 3, (9870 << 3) & 0xFFFF | 9870 >> 13], [np.nan, 1.057, 9.870]),
            ("virtual-kitti-2", [100, 65534, 65535], [1.0, 655.34, np.inf]),
            # d = (v − 1)/256 px: 0 is invalid, 1 is no disparity, 257 is one pixel, 25601 a hundred.
            (
                "cityscapes",
                [0, 1, 257, 25601],
                [np.nan, np.inf, 0.209313 * 2262.52, 0.209313 * 2262.52 / 100],
            ),
        ],
    )
    def test_codes_of_16_bits(self, tmp_path, encoding, codes, metres):
        path = png(tmp_path / "depth.png", [codes])
        depth = read_depth(path, encoding=encoding, camera=STEREO)
        assert depth.values.dtype == np.float32
        assert depth.geometry == "planar"
        np.testing.assert_allclose(depth.values, [metres], rtol=FLOAT32)

    @pytest.mark.parametrize(
        ("encoding", "numbers", "values", "geometry"),
        [
            ("metres", [1.5, np.nan, np.inf], [1.5, np.nan, np.inf], "planar"),
            ("metres-zero-unknown", [1.5, 0, np.inf], [1.5, np.nan, np.inf], "planar"),
            ("metres-radial", [1.5, np.nan, np.inf], [1.5, np.nan, np.inf], "radial"),
            ("hypersim", [1.5, np.nan], [1.5, np.nan], "radial"),
            ("tartanair", [1.5, 4999, 10000], [1.5, 4999, np.inf], "planar"),
            ("relative", [0, 0.25, 1, np.nan], [0, 0.25, 1, np.nan], "relative"),
            # Z = B·f/(d + doffs); the inf of the file is "unknown", not "sky".
            ("middlebury", [0, 69, np.inf], [0.209313 * 2262.52 / 31, 0.209313 * 2262.52 / 100, np.nan], "planar"),
        ],
    )
    @pytest.mark.parametrize("dtype", [np.float32, np.float64])
    def test_real_numbers(self, tmp_path, encoding, numbers, values, geometry, dtype):
        path = npy(tmp_path / "depth.npy", np.array([numbers], dtype))
        depth = read_depth(path, encoding=encoding, camera=STEREO)
        assert depth.geometry == geometry
        np.testing.assert_allclose(depth.values, [values], rtol=FLOAT32)

    def test_relative_of_16_bits(self, tmp_path):
        depth = read_depth(png(tmp_path / "d.png", [[0, 13107, 65535]]), encoding="relative-16bit")
        np.testing.assert_allclose(depth.values, [[0, 0.2, 1]], rtol=FLOAT32)
        assert depth.geometry == "relative"

    def test_exr_z_takes_what_no_ray_hit_for_sky(self, tmp_path):
        path = exr(tmp_path / "d.exr", Z=np.array([[0, 2.5, 1e10, np.inf, np.nan]], np.float32))
        expected = [[np.inf, 2.5, np.inf, np.inf, np.nan]]
        np.testing.assert_array_equal(read_depth(path, encoding="exr-z").values, expected)

    def test_half_precision(self, tmp_path):
        path = exr(tmp_path / "d.exr", Z=np.array([[0, 2.5]], np.float16))
        np.testing.assert_array_equal(read_depth(path, encoding="exr-z").values, [[np.inf, 2.5]])

    def test_codes_may_be_stored_as_npy(self, tmp_path):
        path = npy(tmp_path / "depth.npy", np.array([[0, 1500]], np.int32))
        np.testing.assert_allclose(read_depth(path, encoding="millimetres").values, [[np.nan, 1.5]], rtol=FLOAT32)

    @given(hnp.arrays(np.uint16, (3, 5)))
    def test_every_code_of_sun_is_a_rotation(self, codes):
        from fogpipe.io.depth import _decode

        metres = _decode(None, codes, ENCODINGS["sun"], None)  # type: ignore[arg-type]
        bits = [int(f"{code:016b}"[-3:] + f"{code:016b}"[:-3], 2) for code in codes.ravel().tolist()]
        expected = np.array([np.nan if b == 0 else b / 1000 for b in bits], np.float32).reshape(3, 5)
        np.testing.assert_allclose(metres, expected, rtol=FLOAT32)

    def test_the_formula_is_told_in_words(self):
        assert ENCODINGS["kitti"].formula == "Z = v/256 m"
        assert ENCODINGS["cityscapes"].formula == "Z = baseline·fx/((v − 1)/256) m"
        assert ENCODINGS["middlebury"].formula == "Z = baseline·fx/(v + doffs) m"
        assert ENCODINGS["sun"].formula == "Z = (v>>3 | v<<13)/1000 m"
        assert (ENCODINGS["cityscapes"].codes, ENCODINGS["middlebury"].codes) == ("0 unknown, 1 sky", "inf unknown")

    def test_the_list_can_be_narrowed_to_a_format(self):
        assert "kitti" in encodings_text("png")
        assert "hypersim" not in encodings_text("png")
        assert all(name in encodings_text() for name in ENCODINGS)


class TestFiles:
    """What is stored in a file, format by format."""

    @pytest.mark.parametrize("order", ["<", ">"])
    @pytest.mark.parametrize("scale", [1.0, 0.00392])
    def test_pfm_is_bottom_up_in_either_byte_order_and_its_scale_is_no_factor(self, tmp_path, order, scale):
        values = np.arange(1, 7, dtype=np.float32).reshape(2, 3)
        path = pfm(tmp_path / "d.pfm", values, order, scale=scale)
        np.testing.assert_array_equal(read_depth(path, encoding="metres").values, values)

    def test_npz_with_one_array(self, tmp_path):
        np.savez_compressed(tmp_path / "d.npz", depth=np.full((2, 3), 4.5, np.float32))
        np.testing.assert_array_equal(read_depth(tmp_path / "d.npz", encoding="hypersim").values, np.full((2, 3), 4.5))

    def test_a_trailing_axis_of_one_is_no_channel(self, tmp_path):
        path = npy(tmp_path / "d.npy", np.full((2, 3, 1), 4.5, np.float32))
        assert read_depth(path, encoding="metres").values.shape == (2, 3)

    def test_fortran_order_and_big_endian(self, tmp_path):
        values = np.asfortranarray(np.arange(1, 7, dtype=">f8").reshape(2, 3))
        path = npy(tmp_path / "d.npy", values)
        np.testing.assert_array_equal(read_depth(path, encoding="metres").values, values)

    @pytest.mark.parametrize("channels", [{"Z": 1}, {"R": 0, "left_Z": 1}, {"depth": 1}], ids=str)
    def test_exr_channel_is_z_or_the_only_one_that_can_be_meant(self, tmp_path, channels):
        arrays = {name: np.full((2, 3), 5.0 if is_depth else 9.0, np.float32) for name, is_depth in channels.items()}
        assert (read_depth(exr(tmp_path / "d.exr", **arrays), encoding="exr-z").values == 5).all()

    def test_exr_without_z_lists_its_channels(self, tmp_path):
        one = np.ones((2, 3), np.float32)
        assert "has no channel Z. It has B, G, R;" in refused(exr(tmp_path / "d.exr", R=one, G=one, B=one), "exr-z")

    def test_the_format_is_told_by_the_content(self, tmp_path):
        path = png(tmp_path / "depth.dat", [[256]])
        assert read_depth(path, encoding="kitti").values == 1

    def test_a_note_sums_up_what_was_read(self, tmp_path):
        path = png(tmp_path / "depth.png", [[0, 256, 512, 1024]])
        (note,) = read_depth(path, encoding="kitti").notes
        assert note == "depth.png as kitti (Z = v/256 m): 1 to 4 m, 25.0% unknown, 0.0% sky"

    def test_whole_numbers_are_no_metres(self, tmp_path):
        codes = np.random.default_rng(1).integers(500, 4000, (40, 50)).astype(np.float32)
        codes[:10] = np.nan
        message = refused(npy(tmp_path / "d.npy", codes), "metres")
        assert "as metres, all values are whole numbers, as millimetres and other codes are" in message
        assert read_depth(npy(tmp_path / "d.npy", np.nan_to_num(codes).astype(np.uint16)), encoding="millimetres")

    @pytest.mark.parametrize("kind", ["rounded", "fraction", "few", "half"])
    def test_metres_that_look_like_whole_numbers(self, tmp_path, kind):
        metres = {
            "rounded": np.random.default_rng(1).integers(1, 200, (40, 50)).astype(np.float32),  # a street, to the metre
            "fraction": np.append(np.arange(1.0, 4000), 7.5)[None],
            "few": np.repeat(np.arange(100.0, 1000, 100), 50)[None],  # planes of a test picture
            "half": np.linspace(1024, 4000, 5000).astype(np.float16)[None],  # all of whose numbers are whole there
        }[kind]
        assert read_depth(npy(tmp_path / "d.npy", metres), encoding="metres").values.shape == metres.shape

    def test_a_note_doubts_a_scene_with_nothing_near(self, tmp_path):
        for nearest, doubted in ((299.5, False), (300.5, True)):
            (note,) = read_depth(npy(tmp_path / "d.npy", np.float32([[nearest, 900]])), encoding="metres").notes
            assert ("make sure that the unit is metres" in note) == doubted

    def test_a_note_doubts_metres_below_one(self, tmp_path):
        (note,) = read_depth(npy(tmp_path / "d.npy", np.full((2, 2), 0.5, np.float32)), encoding="metres").notes
        assert "make sure that it is not relative depth" in note

    @pytest.mark.parametrize("encoding", ["metres", "metres-radial", "metres-zero-unknown"])
    def test_a_normalised_map_is_not_in_metres(self, tmp_path, encoding):
        message = refused(npy(tmp_path / "d.npy", np.array([[0.2, 0.5, 1.0, np.nan]], np.float32)), encoding)
        assert "1 of 4 pixels are at exactly 1 m and none is farther" in message
        assert "relative" in message

    @pytest.mark.parametrize("farthest", [0.9, 1.1, np.inf])
    def test_a_close_range_may_be_in_metres(self, tmp_path, farthest):
        path = npy(tmp_path / "d.npy", np.array([[0.2, 0.5, farthest]], np.float32))
        assert read_depth(path, encoding="metres").values[0, 2] == np.float32(farthest)

    def test_a_map_that_is_nearer_at_the_top_is_doubted(self, tmp_path):
        # Flat ground under a horizon at row −1: distance falls with the row as 1/row, inverse depth rises.
        rows = np.arange(1, 121, dtype=np.float32)[:, None] * np.ones((1, 100), np.float32)
        rows[:30, :50] = np.nan
        ground = read_depth(npy(tmp_path / "ground.npy", 150 / rows), encoding="metres")
        inverse = read_depth(npy(tmp_path / "inverse.npy", rows), encoding="metres")
        assert not any("inverse depth?" in note for note in ground.notes)
        assert inverse.notes[1] == "inverse.npy: nearer at the top than at the bottom: is this inverse depth?"

    @pytest.mark.parametrize("kind", ["flat", "noise", "small"])
    def test_a_map_that_says_nothing_is_not_doubted(self, tmp_path, kind):
        rows = np.arange(1, 121, dtype=np.float32)[:, None] * np.ones((1, 100), np.float32)
        noise = np.random.default_rng(0).uniform(2, 3, rows.shape).astype(np.float32)
        values = {"flat": np.full_like(rows, 3), "noise": noise, "small": rows[:90]}[kind]
        assert len(read_depth(npy(tmp_path / "d.npy", values), encoding="metres").notes) == 1

    def test_doubt_begins_at_a_rank_correlation_of_0_6(self, tmp_path):
        from scipy.stats import spearmanr

        row = np.repeat(np.arange(100.0), 100)
        noise = np.random.default_rng(1).normal(size=row.size)
        doubted, expected = [], []
        for slope in (0.015, 0.02, 0.025, 0.03, 0.035):
            distance = np.round(slope * row + noise, 1) + 10  # rounded as codes are: equal values share a rank
            notes = read_depth(npy(tmp_path / "d.npy", distance.reshape(100, 100)), encoding="metres").notes
            doubted.append(len(notes) == 2)
            expected.append(spearmanr(row, distance).statistic >= 0.6)
        assert doubted == expected
        assert set(expected) == {False, True}

    def test_an_all_sky_map_is_allowed(self, tmp_path):
        path = npy(tmp_path / "d.npy", np.full((2, 2), np.inf, np.float32))
        assert np.isposinf(read_depth(path, encoding="metres").values).all()


class TestRefusals:
    """No silent guess: what cannot be depth, or does not say what it is, is refused."""

    def test_an_unnamed_encoding_lists_what_the_file_may_be(self, tmp_path):
        message = refused(png(tmp_path / "d.png", [[1]]), None)
        assert "name the encoding" in message
        assert "kitti" in message
        assert "hypersim" not in message

    def test_an_unknown_encoding_suggests_one(self, tmp_path):
        with pytest.raises(InputError, match=r'no depth encoding "kiti"\. Did you mean "kitti"\?'):
            read_depth(png(tmp_path / "d.png", [[1]]), encoding="kiti")

    def test_a_depth_with_an_orientation_tag(self, tmp_path):
        from PIL import Image

        exif = Image.Exif()
        exif[0x0112] = 6
        Image.fromarray(np.full((2, 3), 1000, np.uint16)).save(tmp_path / "d.png", exif=exif)
        assert "has EXIF orientation 6, as a picture has" in refused(tmp_path / "d.png", "millimetres")

    @pytest.mark.parametrize(
        ("colour", "bits", "message"),
        [
            (0, 8, "has 8 bits per pixel: a picture of depth"),
            (2, 8, "is a colour picture, a photograph or one of depth"),
            (2, 16, "is a colour picture, a photograph or one of depth"),
            (3, 8, "is a palette picture, a photograph or one of depth"),
            (4, 8, "is a grey with alpha picture, a photograph or one of depth"),
            (6, 8, "is a colour with alpha picture, a photograph or one of depth"),
        ],
    )
    def test_pictures_of_depth(self, tmp_path, colour, bits, message):
        samples = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[colour]
        assert message in refused(png(tmp_path / "d.png", np.ones((2, 2 * samples)), bits, colour), "kitti")

    @pytest.mark.parametrize(
        ("array", "encoding", "message"),
        [
            (np.ones((2, 3, 3), np.float32), "metres", "has the shape (2, 3, 3)"),
            (np.ones(5, np.float32), "metres", "has the shape (5,)"),
            (np.ones((0, 4), np.float32), "metres", "has the shape (0, 4)"),
            (np.ones((2, 2), np.complex64), "metres", "holds complex64 values"),
            (np.ones((2, 2), bool), "metres", "holds bool values"),
            (np.array([["a"]]), "metres", "holds <U1 values"),
            (np.ones((2, 2), np.uint8), "millimetres", "holds 8-bit values"),
            (np.ones((2, 2), np.float32), "millimetres", "is made of whole numbers"),
            (np.ones((2, 2), np.uint16), "metres", "is made of real numbers"),
            (np.ones((2, 2), np.int64), "sun", "rotates the bits of uint16"),
            (np.ones((2, 2), np.float32), "kitti", "is made of whole numbers"),
            (np.array([[1, -2]], np.float32), "metres", "1 of 2 pixels have a negative depth"),
            (np.array([[1, -np.inf]], np.float32), "metres", "1 of 2 pixels have a negative depth"),
            (np.array([[1, -2]], np.int32), "millimetres", "1 of 2 pixels have a negative depth"),
            (np.array([[-99.0, 1]], np.float32), "middlebury", "1 of 2 pixels have a negative depth"),
            (np.array([[1, 0, 0]], np.float32), "metres", "2 of 3 pixels are at 0 m"),
            (np.array([[1, 1e7]], np.float32), "metres", "1 of 2 pixels are farther than 1000 km"),
            (np.array([[1, 1e300]], np.float64), "metres", "1 of 2 pixels are farther than 1000 km"),
            (np.full((2, 2), np.nan, np.float32), "metres", "no pixel holds a depth"),
            (np.zeros((2, 2), np.uint16), "kitti", "no pixel holds a depth (0 unknown)"),
            (np.array([[0.5, 1.5]], np.float32), "relative", "1 of 2 pixels are above 1"),
            (np.array([[0.5, np.inf]], np.float32), "relative", "1 of 2 pixels are above 1"),
        ],
        ids=lambda value: str(getattr(value, "dtype", value))[:24],
    )
    def test_arrays_that_are_no_depth(self, tmp_path, array, encoding, message):
        assert message in refused(npy(tmp_path / "d.npy", array), encoding, STEREO)

    def test_pickled_objects_are_never_read(self, tmp_path):
        path = tmp_path / "d.npy"
        np.save(path, np.array([[{"depth": 1}]], object), allow_pickle=True)
        assert "pickled" in refused(path, "metres")

    def test_an_encoding_that_the_format_cannot_hold(self, tmp_path):
        assert "metres is stored as npy, npz, pfm, exr, not as png" in refused(png(tmp_path / "d.png", [[1]]), "metres")

    def test_missing_empty_and_foreign_files(self, tmp_path):
        assert "there is no such file" in refused(tmp_path / "none.png", "kitti")
        (tmp_path / "empty.png").touch()
        assert "is empty (0 bytes)" in refused(tmp_path / "empty.png", "kitti")
        (tmp_path / "d.txt").write_text("1 2 3")
        assert "is no format that depth is read from" in refused(tmp_path / "d.txt", "kitti")

    @pytest.mark.parametrize("kind", ["png", "npy", "npz", "pfm", "exr"])
    @pytest.mark.parametrize("share", [0.02, 0.5, 0.95])
    def test_truncated_files(self, tmp_path, kind, share, capfd):
        values = np.random.default_rng(0).uniform(1, 9, (40, 50)).astype(np.float32)
        path = tmp_path / f"d.{kind}"
        if kind == "png":
            png(path, (values * 1000).astype(np.uint16))
        elif kind == "npz":
            np.savez(path, depth=values)
        else:
            {"npy": npy, "pfm": pfm, "exr": lambda path, values: exr(path, Z=values)}[kind](path, values)
        path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
        refused(path, "kitti" if kind == "png" else "metres")

    @pytest.mark.parametrize(
        ("header", "message"),
        [
            (b"PF\n2 2\n-1\n" + bytes(48), "is a colour PFM"),
            (b"Pf\n999999999 999999999\n-1\n" + bytes(16), "is cut off"),
            (b"Pf\n0 2\n-1\n", "has the shape (2, 0)"),
            (b"Pf\n-2 2\n-1\n" + bytes(16), "is not a valid PFM file"),
            (b"Pf\n2 2\n0\n" + bytes(16), "is not a valid PFM file"),
            (b"Pf\n2 2\nnan\n" + bytes(16), "is not a valid PFM file"),
            (b"Pf\n2 2\n" + bytes(16), "is not a valid PFM file"),
            (b"Pf " + b"9" * 5000, "is not a valid PFM file"),
        ],
        ids=lambda value: str(value)[:24],
    )
    def test_hostile_pfm(self, tmp_path, header, message):
        path = tmp_path / "d.pfm"
        path.write_bytes(header)
        assert message in refused(path, "metres")

    def test_a_header_that_promises_terabytes(self, tmp_path):
        path = png(tmp_path / "d.png", [[1]])
        data = bytearray(path.read_bytes())
        data[16:24] = struct.pack(">II", 2**20, 2**20)
        data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
        path.write_bytes(data)
        assert "1048576×1048576" in refused(path, "kitti")

    def test_several_arrays_in_one_file(self, tmp_path):
        np.savez(tmp_path / "d.npz", a=np.ones((2, 2)), b=np.ones((2, 2)))
        assert "holds 2 arrays" in refused(tmp_path / "d.npz", "metres")

    def test_disparity_needs_its_camera(self, tmp_path):
        path = png(tmp_path / "d.png", [[257]])
        assert "cityscapes is disparity and needs a camera file" in refused(path, "cityscapes")
        bare = CameraFile(STEREO.matrix, source="bare.json")
        assert "needs bare.json to state baseline" in refused(path, "cityscapes", bare)
        no_offset = CameraFile(STEREO.matrix, baseline=0.2, source="bare.json")
        disparities = npy(tmp_path / "d.npy", np.ones((1, 1), np.float32))
        assert "needs bare.json to state baseline and doffs" in refused(disparities, "middlebury", no_offset)

    def test_a_resized_disparity_map(self, tmp_path):
        camera = CameraFile(STEREO.matrix, baseline=0.2, size=(2048, 1024), source="c.json")
        path = png(tmp_path / "d.png", np.full((5, 10), 257))
        assert "has 10×5 disparities, but c.json states another size" in refused(path, "cityscapes", camera)


class TestRange:
    """From depth to the distance along the ray."""

    def test_planar_becomes_radial_with_a_camera(self):
        camera = CameraFile(np.array([[4.0, 0, 0], [0, 4, 0], [0, 0, 1]]), source="c.json")
        depth = DepthMap(np.full((1, 4), 4.0, np.float32), "planar", ())
        range_map, notes = to_range(depth, camera)
        # Column 3 is at x = 3 m where z = 4 m: the 3-4-5 triangle.
        np.testing.assert_allclose(range_map, [[4, np.sqrt(17), np.sqrt(20), 5]], rtol=FLOAT32)
        assert notes == ("planar depth made radial with c.json",)

    def test_without_a_camera_it_says_so(self):
        depth = DepthMap(np.full((1, 4), 4.0, np.float32), "planar", ())
        range_map, (note,) = to_range(depth, None)
        np.testing.assert_array_equal(range_map, depth.values)
        assert "no camera: planar depth is taken for the distance along the ray" in note
        assert "Pass a camera" in note

    def test_radial_stays_as_it_is(self):
        depth = DepthMap(np.full((1, 4), 4.0, np.float32), "radial", ())
        range_map, notes = to_range(depth, STEREO)
        assert range_map is depth.values
        assert notes == ()

    def test_relative_depth_is_no_range(self):
        with pytest.raises(InputError, match="relative depth has no unit"):
            to_range(DepthMap(np.ones((1, 1), np.float32), "relative", ()), None)


class TestRealFiles:
    """Files of the data sets themselves, against figures that do not come from this decoder."""

    def raw(self, path):
        from PIL import Image

        with Image.open(path) as picture:
            return np.asarray(picture).astype(np.float64)

    def test_kitti(self, shared_data):
        path = shared_data / "kitti" / "depth.png"
        depth = read_depth(path, encoding="kitti").values
        raw = self.raw(path)
        assert depth.shape == (375, 1242)
        np.testing.assert_array_equal(np.isnan(depth), raw == 0)
        np.testing.assert_array_equal(depth[raw > 0], (raw / 256)[raw > 0])  # a division by 2⁸ is exact
        # A Velodyne returns from 5 to 85 m here, and fills about a fifth of the pixels.
        assert 4 < np.nanmin(depth) < 7
        assert 80 < np.nanmax(depth) < 90
        assert 0.18 < np.isfinite(depth).mean() < 0.22

    def test_kitti_becomes_radial(self, shared_data):
        camera = CameraFile(np.array([[707.0493, 0, 604.0814], [0, 707.0493, 180.5066], [0, 0, 1]]))
        depth = read_depth(shared_data / "kitti" / "depth.png", encoding="kitti")
        range_map, _ = to_range(depth, camera)
        ratio = range_map / depth.values
        # At the side of the image the ray is inclined by atan(637/707) = 42°: 1/cos is 1.35.
        assert np.nanmin(ratio) == pytest.approx(1, abs=1e-3)
        assert 1.3 < np.nanmax(ratio) < 1.38

    @pytest.mark.parametrize(
        ("name", "encoding", "least", "most"),
        [
            ("depth_mm.png", "millimetres", 0.9, 2.8),
            ("tum_depth.png", "tum", 1.4, 9.5),
            ("sun_depth.png", "sun", 1.0, 10.0),
        ],
    )
    def test_indoor_sensors_measure_rooms(self, shared_data, name, encoding, least, most):
        path = shared_data / "kinect" / name
        depth = read_depth(path, encoding=encoding).values
        assert depth.shape == (480, 640)
        assert least < np.nanmin(depth) < np.nanmax(depth) < most
        np.testing.assert_array_equal(np.isnan(depth), self.raw(path) == 0)
        assert 0.1 < np.isnan(depth).mean() < 0.2

    def test_exr_z(self, shared_data):
        depth = read_depth(shared_data / "exr" / "beachball.exr", encoding="exr-z").values
        assert depth.shape == (876, 911)
        background = np.isposinf(depth)
        assert background.mean() == pytest.approx(0.252, abs=0.001)  # a quarter of the picture, by count
        assert (depth.min(), depth[~background].max()) == (9.0, pytest.approx(10.92, abs=0.005))

    def test_exr_z_as_metres_is_refused_for_its_zeros(self, shared_data):
        assert "pixels are at 0 m" in refused(shared_data / "exr" / "beachball.exr", "metres")
