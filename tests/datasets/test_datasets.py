"""Laws of datasets: every format gives the same images, what is broken is said, and labels go with pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from toy_datasets import (
    TABLE,
    box,
    grasp_of,
    write_cornell,
    write_frames,
    write_jacquard,
    write_multi_object,
    write_point_cloud,
)
from toy_shards import write_shards

from mpgrasp.datasets.cornell import Cornell, from_corners
from mpgrasp.datasets.depth_files import read_depth, read_depth_array, read_point_cloud
from mpgrasp.datasets.depth_folder import FOCAL_SHARE, DepthFolder
from mpgrasp.datasets.generated import STEP, Generated
from mpgrasp.datasets.jacquard import Jacquard
from mpgrasp.datasets.labelled_image import LabelledImage, window
from mpgrasp.datasets.multi_object import MultiObject
from mpgrasp.datasets.reader import BrokenImageError, Reader, Skipped, usable
from mpgrasp.exceptions import ConfigError
from mpgrasp.geometry import line_angle_difference
from mpgrasp.training.data.labels import decode_angle


def cornell(tmp_path: Path) -> Reader:
    return Cornell(write_cornell(tmp_path / "a folder"))


def jacquard(tmp_path: Path) -> Reader:
    return Jacquard(write_jacquard(tmp_path / "a folder"))


def multi_object(tmp_path: Path) -> Reader:
    return MultiObject(write_multi_object(tmp_path / "a folder"))


def test_one_image_that_is_left_out_is_said_in_the_singular() -> None:
    assert str(Skipped({"0101": "no depth"})) == "1 image was left out, 0101: no depth"


@pytest.mark.parametrize("made", [cornell, jacquard, multi_object])
def test_a_dataset_has_the_images_and_the_labels_that_were_written(
    made: Callable[[Path], Reader], tmp_path: Path
) -> None:
    reader, skipped = made(tmp_path), Skipped()
    images = list(usable(reader, skipped))
    assert len(images) == 3
    assert str(skipped) == "no image was left out"
    for k, image in enumerate(images):
        (label,) = image.rectangles
        true = grasp_of(0.4 * k, image.depth.shape)
        assert np.allclose([label.u, label.v], [true.u, true.v], atol=0.01)
        assert float(line_angle_difference(label.angle, true.angle)) < 1e-4
        assert label.iou(true) > 0.99
        assert image.rgb is not None
        assert np.nanmedian(image.depth) == pytest.approx(TABLE, abs=1e-3)
    assert [image.object for image in images] == [reader.object_of(name) for name in reader.names]
    assert len({image.object for image in images}) == (3 if isinstance(reader, MultiObject) else 2)


def test_a_folder_of_frames_has_labels_and_colour_where_they_lie_beside_the_depth(tmp_path: Path) -> None:
    reader = DepthFolder(write_frames(tmp_path / "my frames"))
    images = {name: reader.read(name) for name in reader.names}
    assert list(images) == ["a", "b", "more/c"]
    assert [image.unit for image in images.values()] == ["m", "m", "mm"]
    assert [len(image.rectangles) for image in images.values()] == [1, 0, 0]
    assert [image.rgb is not None for image in images.values()] == [False, True, False]
    assert images["a"].rectangles[0].iou(grasp_of(0.0, (300, 400))) > 0.99
    assert images["b"].focal_px == FOCAL_SHARE * 400
    assert DepthFolder(tmp_path / "my frames", 321.0).read("b").focal_px == 321.0
    for image in images.values():
        assert np.nanmedian(image.depth) == pytest.approx(TABLE, abs=1e-3)


@pytest.mark.parametrize("array", [np.zeros((4, 5)), np.full((4, 5, 3), 1.0), np.array([object()]), "junk"])
def test_an_array_that_is_no_depth_image_is_broken(array: np.ndarray | str, tmp_path: Path) -> None:
    path = tmp_path / "d.npy"
    if isinstance(array, str):
        path.write_text(array)
    else:
        np.save(path, array)
    with pytest.raises(BrokenImageError, match=r"d\.npy"):
        read_depth_array(path)
    with pytest.raises(BrokenImageError, match=r"absent\.npy"):
        read_depth_array(tmp_path / "absent.npy")


def test_generated_data_have_rectangles_where_labels_are_good(tmp_path: Path) -> None:
    reader = Generated(write_shards(tmp_path / "set", shards=2, images=3))
    assert len(reader.names) == 6
    assert reader.object_of(reader.names[4]) == "scene 4"
    for name in reader.names:
        image = reader.read(name)
        path, row = tmp_path / "set" / f"shard_{name[:5]}.npz", int(name[6:])
        with np.load(path) as file:
            quality, angle, width = (file[key][row] for key in ("quality", "angle", "width"))
        good = quality >= 0.5 * quality.max()
        assert len(image.rectangles) == good[::STEP, ::STEP].sum()
        for rectangle in image.rectangles:
            at = round(rectangle.v), round(rectangle.u)
            assert good[at]
            assert rectangle.width_px == width[at]
            assert rectangle.angle == decode_angle(angle)[at]
    with pytest.raises(ConfigError, match="no shards"):
        Generated(tmp_path)


@pytest.mark.parametrize("missing", ["rgb_0001.jpg", "depth_0001.png"])
def test_a_multi_object_image_without_its_pair_is_left_out(missing: str, tmp_path: Path) -> None:
    folder = write_multi_object(tmp_path / "m")
    (folder / "rgbd" / missing).unlink()
    skipped = Skipped()
    assert [image.name for image in usable(MultiObject(folder), skipped)] == ["0000", "0002"]
    assert missing.partition(".")[0] in skipped.reasons["0001"]


def test_a_point_cloud_has_the_depth_of_its_tiff_but_for_the_points_that_it_lacks(tmp_path: Path) -> None:
    depth = box(0.3, (480, 640))
    write_point_cloud(tmp_path / "pcd0100.txt", depth)
    found = read_point_cloud(tmp_path / "pcd0100.txt")
    missing = np.isnan(found)
    assert missing.sum() == len(range(5, depth.size, 97))
    assert np.allclose(found[~missing], depth[~missing], atol=1e-5)


@pytest.mark.parametrize(
    ("values", "unit"), [(np.float32(0.8), "m"), (np.float32(800.0), "mm"), (np.uint16(800), "mm")]
)
def test_the_unit_of_a_depth_image_is_found(values: np.generic, unit: str, tmp_path: Path) -> None:
    image = np.full((40, 60), values)
    image[:5] = 0
    cv2.imwrite(str(tmp_path / "d.tiff"), image)
    depth, found = read_depth(tmp_path / "d.tiff")
    assert found == unit
    assert np.isnan(depth[:5]).all()
    assert np.allclose(depth[5:], 0.8)


def test_what_is_missing_or_torn_is_left_out_with_its_reason_or_ends_it_all(tmp_path: Path) -> None:
    folder = write_cornell(tmp_path / "c", count=6)
    inside = folder / "01"
    (inside / "pcd0101cpos.txt").unlink()
    (inside / "pcd0102cpos.txt").write_text("NaN NaN\n" * 8)
    tiff = inside / "pcd0103d.tiff"
    tiff.write_bytes(tiff.read_bytes()[:500])
    (inside / "pcd0104r.png").write_bytes(b"")
    skipped = Skipped()
    assert [image.name for image in usable(Cornell(folder), skipped)] == ["0100", "0105"]
    assert set(skipped.reasons) == {"0101", "0102", "0103", "0104"}
    assert "pcd0101cpos.txt: No such file" in skipped.reasons["0101"]
    assert "no rectangle" in skipped.reasons["0102"]
    assert "pcd0103d.tiff: no whole image" in skipped.reasons["0103"]
    assert "4 images were left out, the first one 0101" in str(skipped)
    with pytest.raises(ConfigError, match=r"a broken image of Cornell: pcd0101cpos\.txt"):
        list(usable(Cornell(folder), Skipped(), strict=True))
    assert len(list(usable(Cornell(folder), Skipped(), limit=1))) == 1


def test_a_line_that_is_no_grasp_is_said(tmp_path: Path) -> None:
    folder = write_jacquard(tmp_path / "j", count=1)
    (folder / "part 0" / "0_abc0_grasps.txt").write_text("1;2;3\n")
    with pytest.raises(BrokenImageError, match="no x;y;theta;opening;jaw: '1;2;3'"):
        Jacquard(folder).read("0_abc0")
    with pytest.raises(ConfigError, match="no usable image of Jacquard"):
        list(usable(Jacquard(folder), Skipped()))


def test_holes_of_stereo_are_holes_and_perfect_depth_has_none(tmp_path: Path) -> None:
    folder = write_jacquard(tmp_path / "j", count=1)
    assert np.isnan(Jacquard(folder, "stereo").read("0_abc0").depth[10:60, 10:60]).all()
    assert np.isfinite(Jacquard(folder, "perfect").read("0_abc0").depth).all()
    with pytest.raises(ConfigError, match="unknown depth of Jacquard; got 'lidar'"):
        Jacquard(folder, "lidar")  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", [Cornell, Jacquard])
def test_a_folder_without_a_dataset_is_refused(kind: type[Cornell] | type[Jacquard], tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"no (Cornell|Jacquard) dataset"):
        kind(tmp_path)


def test_corners_in_any_order_of_turn_are_the_same_rectangle() -> None:
    true = grasp_of(0.3, (480, 640))
    corners = true.corners()
    for turned in (corners, corners[[1, 0, 3, 2]], corners[[2, 3, 0, 1]]):
        assert from_corners(turned).iou(true) == pytest.approx(1.0, abs=1e-3)


def labelled(angle: float = 0.5) -> LabelledImage:
    shape = (480, 640)
    return LabelledImage(
        name="x",
        object="x",
        depth=box(angle, shape),
        rgb=None,
        rectangles=(grasp_of(angle, shape),),
        focal_px=525.0,
    )


@pytest.mark.parametrize("turn", [0.0, 0.7, -1.2, np.pi])
@pytest.mark.parametrize(("side", "size"), [(300.0, 300), (400.0, 224), (200.0, 350)])
def test_labels_turn_and_scale_with_their_image(turn: float, side: float, size: int) -> None:
    seen = window(labelled(), (330.0, 250.0), side, size, turn)
    (label,) = seen.rectangles
    object_mask = (seen.depth < TABLE - 0.02).astype(np.uint8)
    (u, v), (long, short), _ = cv2.minAreaRect(
        np.column_stack(np.nonzero(object_mask)[::-1]).astype(np.float32)
    )
    assert np.allclose([label.u, label.v], [u, v], atol=1.5)
    assert label.angle == pytest.approx((0.5 + np.pi / 2 + turn + np.pi / 2) % np.pi - np.pi / 2, abs=1e-6)
    assert label.width_px == pytest.approx(60 * size / side)
    assert max(long, short) == pytest.approx(120 * size / side, rel=0.05)


def test_two_labels_overlap_as_much_in_every_window() -> None:
    image = labelled()
    other = grasp_of(0.9, (480, 640))
    pair = replace(image, rectangles=(*image.rectangles, other))
    before = pair.rectangles[0].iou(pair.rectangles[1])
    for turn, side in ((0.4, 250.0), (2.0, 333.0)):
        a, b = window(pair, (300.0, 200.0), side, 224, turn).rectangles
        assert a.iou(b) == pytest.approx(before, abs=1e-4)


def test_a_window_of_the_image_itself_changes_nothing() -> None:
    image = labelled()
    same = window(image, (319.5, 239.5), 480.0, 480)
    assert np.allclose(same.depth, image.depth[:, 80:560], atol=1e-6)
    assert same.rectangles[0].u == pytest.approx(image.rectangles[0].u - 80)
    assert same.focal_px == image.focal_px
    assert window(image, (319.5, 239.5), 480.0, 240).focal_px == image.focal_px / 2


def test_a_hole_does_not_spread_and_mixes_with_nothing() -> None:
    image = labelled()
    depth = image.depth.copy()
    depth[100:120, 300:320] = np.nan
    seen = window(replace(image, depth=depth), (319.5, 239.5), 480.0, 480)
    assert np.array_equal(np.isnan(seen.depth), np.isnan(depth[:, 80:560]))
    assert np.nanmin(seen.depth) > 0.7


def test_what_lies_beyond_the_image_has_no_depth() -> None:
    seen = window(labelled(), (0.0, 0.0), 100.0, 100)
    assert np.isnan(seen.depth[:45, :45]).all()
    assert np.isfinite(seen.depth[60:, 60:]).all()
    with pytest.raises(ConfigError, match="unusable window"):
        window(labelled(), (0.0, 0.0), 0.0, 100)
