"""Scenes as files that the plain MuJoCo viewer opens: one XML and a folder of meshes beside it.

    python -m mpgrasp.scene thin --seed 3 --out scene.xml
    python -m mujoco.viewer --mjcf scene.xml

Key frame "start" holds the settled state with the arm at home.
"""

from __future__ import annotations

import shutil
from pathlib import Path

from mpgrasp.exceptions import OutputError
from mpgrasp.files.atomic import replace_file
from mpgrasp.scene.scene import Scene


def save_scene(scene: Scene, path: str | Path) -> list[Path]:
    """Write the scene as XML with relative references to copies of its mesh files.

    Args:
        scene: the scene, in its settled state.
        path: the XML file to write; meshes go into the folder `<stem>_assets` beside it.

    Returns:
        the files written.

    Raises:
        OutputError: the XML or the folder cannot be written.
    """
    path = Path(path)
    assets = path.parent / f"{path.stem}_assets"
    spec = scene.spec.copy()
    data = scene.data()
    spec.add_key(name="start", qpos=data.qpos, qvel=data.qvel, ctrl=data.ctrl)
    written = [path]
    try:
        if path.is_dir():  # before its meshes are written beside it
            raise IsADirectoryError(f"it is a directory: {path}")
        path.parent.mkdir(parents=True, exist_ok=True)
        xml = spec.to_xml()
        for source in sorted({Path(mesh.file) for mesh in spec.meshes if mesh.file}):
            target = assets / source.name
            assets.mkdir(exist_ok=True)
            shutil.copyfile(source, target)
            xml = xml.replace(f'file="{source}"', f'file="{assets.name}/{target.name}"')
            written.append(target)
        replace_file(path, xml)
    except OSError as error:
        raise OutputError(
            "cannot write the scene", got=str(path), allowed=f"a writable file ({error})"
        ) from None
    return written
