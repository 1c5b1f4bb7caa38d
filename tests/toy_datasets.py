"""Tiny datasets in the formats of all readers, made here: one box on a table in every image."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from mpgrasp.grasp import GraspRectangle

TABLE, TOP = 0.8, 0.76


def box(angle: float, shape: tuple[int, int], *, long: float = 120.0, short: float = 40.0) -> np.ndarray:
    """Depth of a box in the middle [m]; its long side is at an angle in the image [rad]."""
    v, u = np.indices(shape, float)
    x, y = u - (shape[1] - 1) / 2, -(v - (shape[0] - 1) / 2)
    along, across = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
    depth = np.where((np.abs(along) < long / 2) & (np.abs(across) < short / 2), TOP, TABLE)
    return (depth + np.random.default_rng(0).normal(0, 3e-4, shape)).astype(np.float32)


def grasp_of(angle: float, shape: tuple[int, int]) -> GraspRectangle:
    """The grasp across that box."""
    return GraspRectangle(
        u=(shape[1] - 1) / 2, v=(shape[0] - 1) / 2, angle=angle + np.pi / 2, width_px=60.0, jaw_px=30.0
    )


def write_cornell(folder: Path, count: int = 3) -> Path:
    """Write a dataset like Cornell's; the first image has a point cloud and no tiff."""
    inside = folder / "01"
    inside.mkdir(parents=True)
    for k in range(count):
        angle, stem = 0.4 * k, inside / f"pcd{100 + k:04d}"
        depth = box(angle, (480, 640))
        cv2.imwrite(f"{stem}r.png", np.full((480, 640, 3), 200, np.uint8))
        if k:
            cv2.imwrite(f"{stem}d.tiff", depth)
        else:
            write_point_cloud(Path(f"{stem}.txt"), depth)
        corners = grasp_of(angle, (480, 640)).corners()
        lines = "".join(f"{u:.3f} {v:.3f} \n" for u, v in corners)
        Path(f"{stem}cpos.txt").write_text("NaN NaN \n" * 4 + lines)
    rows = "".join(f"{100 + k} {7 + k // 2} 1 background\n" for k in range(count))
    (folder / "z.txt").write_text(rows)
    return folder


def write_point_cloud(path: Path, depth: np.ndarray) -> None:
    """Write a point cloud whose distances are a depth image's, with every 97th pixel missing."""
    index = np.arange(depth.size)
    index = index[index % 97 != 5]
    direction = np.array([0.6, 0.0, 0.8])
    rows = depth.flat[index][:, None] * 1000 * direction
    head = "# .PCD v.7 - Point Cloud Data file format\nFIELDS x y z rgb index\nDATA ascii\n"
    body = "\n".join(f"{x:.4f} {y:.4f} {z:.4f} 0 {k}" for (x, y, z), k in zip(rows, index, strict=True))
    path.write_text(head + body + "\n")


def write_jacquard(folder: Path, count: int = 3) -> Path:
    """Write a dataset like Jacquard's, in two folders."""
    for k in range(count):
        angle, inside = 0.4 * k, folder / f"part {k % 2}"
        inside.mkdir(parents=True, exist_ok=True)
        stem, depth = inside / f"{k}_abc{k % 2}", box(angle, (512, 512))
        cv2.imwrite(f"{stem}_RGB.png", np.full((512, 512, 3), 200, np.uint8))
        cv2.imwrite(f"{stem}_perfect_depth.tiff", depth)
        holed = depth.copy()
        holed[10:60, 10:60] = -1.0
        cv2.imwrite(f"{stem}_stereo_depth.tiff", holed)
        grasp = grasp_of(angle, (512, 512))
        theta = -np.rad2deg(grasp.angle)
        good = f"{grasp.u};{grasp.v};{theta};{grasp.width_px};{grasp.jaw_px}\n"
        Path(f"{stem}_grasps.txt").write_text(good + "1;2;nan;3;4\n1;2;3;0;4\n")
    return folder


def write_multi_object(folder: Path, count: int = 3) -> Path:
    """Write a dataset like the multi-object one: images and annotations in folders of their own."""
    for name in ("rgbd", "annotations"):
        (folder / name).mkdir(parents=True)
    for k in range(count):
        angle = 0.4 * k
        depth = np.rint(1000 * box(angle, (480, 640))).astype(np.uint16)
        cv2.imwrite(str(folder / "rgbd" / f"rgb_{k:04d}.jpg"), np.full((480, 640, 3), 200, np.uint8))
        cv2.imwrite(str(folder / "rgbd" / f"depth_{k:04d}.png"), depth)
        corners = grasp_of(angle, (480, 640)).corners()
        text = "".join(f"{u:.4f} {v:.4f}\n" for u, v in corners)
        (folder / "annotations" / f"rgb_{k:04d}_annotations.txt").write_text(text)
        (folder / "annotations" / f"rgb_{k:04d}_annotations.txt~").write_text("1 2\n")
    return folder


def write_frames(folder: Path) -> Path:
    """Write three depth images of one's own: npy with a label, TIFF with colour, PNG in millimetres."""
    (folder / "more").mkdir(parents=True)
    shape = (300, 400)
    np.save(folder / "a.npy", box(0.0, shape))
    grasp = grasp_of(0.0, shape)
    theta = -np.rad2deg(grasp.angle)
    (folder / "a_grasps.txt").write_text(f"{grasp.u};{grasp.v};{theta};{grasp.width_px};{grasp.jaw_px}\n")
    cv2.imwrite(str(folder / "b.tiff"), box(0.4, shape))
    cv2.imwrite(str(folder / "b_RGB.png"), np.full((*shape, 3), 200, np.uint8))
    cv2.imwrite(str(folder / "more" / "c.png"), np.rint(1000 * box(0.8, shape)).astype(np.uint16))
    return folder
