"""Named data and paths: a real day of the ATC mall, or anybody's own files.

The real day is the public 1 Hz version of 2012-10-24, pinned to a commit and to the SHA-256 of each
file.  The ATC data are free for research; cite Brscic, Kanda, Ikeda, Miyashita, "Person tracking in
large public spaces using 3-D range sensors", IEEE Trans. Human-Machine Systems 43(6), 2013.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import pooch

from ..errors import DataError

SYNTHETIC, ATC_1HZ = "synthetic", "atc-1hz"

ATC_1HZ_URL = (
    "https://raw.githubusercontent.com/test-bai-cpu/online-mod/"
    "1b44eb4f1be13a669d0b8349d4c71dbb8711078e/dataset/atc/split_data_random/"
)
ATC_1HZ_FILES = {
    "atc-1024-10_test.csv": "e9c7b9eb92e87b748e18723b9a2c18e3386fc720fb055446dae54b1cb617168c",
    "atc-1024-10_train.csv": "170b4a3750a5b9c85092a7bf9e6dc2ac0914b3c4d24e38412e1cd2fa3dac4629",
    "atc-1024-11_test.csv": "e1f26841d367ee7e1b7368c96abab4503eb2e053c7b20e99947fed1259dcad7b",
    "atc-1024-11_train.csv": "56358a287692dadee5361f37a6a1434c46a2df500f7fa15aff5cb1c2db96c542",
    "atc-1024-12_test.csv": "c12aba1668edb1370244810904cac58b53b34d4b573a63a697d714c0ac33e37e",
    "atc-1024-13_test.csv": "b6c39462adac619320fedebe1cbab51952e73e93bdc5f05c4b4f8503da8df5bc",
    "atc-1024-13_train.csv": "fa20b5be018d4a6669ecc0f5e61906a25efeffa4ca2d58da7bcebb7eac43831e",
    "atc-1024-14_test.csv": "4cef797a0b194f949b321348156d4cc588973529ceca6d6ad7718656469cf9e9",
    "atc-1024-14_train.csv": "c4381a32322e9432ad2dc39894a3f340b51b3640583ed9f7dbbf37fe8b056b17",
    "atc-1024-15_test.csv": "96b414f0af20170f11e2aeafcbdbac61e60adbc6833e7275702bbf795dc7a2f4",
    "atc-1024-15_train.csv": "ec91f5ebb037ec578b0ff023a3dbdaef1b86c2d32b4ff7b69e3e8c64c8826405",
    "atc-1024-16_test.csv": "080985cfbdaae0ee8cc47cd11973870bf261be4010f26346f4d972d3c3452400",
    "atc-1024-16_train.csv": "389772aaee559240563fc9acf0d3661bca5d0918e66768aa33fc1b581b7ece41",
    "atc-1024-17_test.csv": "49ebd370c17dea1d169c0e32befedca5f78c3b845eda5213046b286c4ea0f58d",
    "atc-1024-17_train.csv": "4431b89ab121b1f5028235a582b9f45ce8682ea587983734ec76d738019ebf76",
    "atc-1024-18_test.csv": "992eb18a78229a4db066a74de3e350ea3dc17941c98f2c7b58865ea8f0e5383a",
    "atc-1024-18_train.csv": "5e402b7be1bf1154d2782e0073cc3d1dcedcb0c53c49c236ee75b14a6ce1c2d9",
    "atc-1024-19_test.csv": "d8c44c64d7970725e411e2df90437f67bceda2874c496aa9175906922c1658da",
    "atc-1024-19_train.csv": "3d269d282e070e5e69a1cadeb2f623268f2852501a949ed75f98487a29d66a2e",
    "atc-1024-20_test.csv": "b2e68c64725e8e2a7f5d18a5464c68918a87de66fdc07b467cb59d63ebde2348",
    "atc-1024-20_train.csv": "9dd847deeac232cc041380fc4e71a5a89b11cf4c215e3b3c05d85db34961e35f",
    "atc-1024-9_test.csv": "7e65413f58199c25a29c2e2e6663e9393ee9d0e1a3a221af9caddbd388738bf2",
    "atc-1024-9_train.csv": "f829bae787cfc0ed5db420e61ba7d58e797ddc3fe02404ac4b6d1d2eadce0b4d",
}
"""SHA-256 by file name; hour 12 is public in part only (10 % of the people)."""

DATA_DIR_VARIABLE = "SZLIB_DATA_DIR"
"""A folder that holds `atc-1hz/`, to be used instead of the network."""


def find(data: str | Path | Sequence[str | Path]) -> list[Path]:
    """The files of a data set.

    Parameters
    ----------
    data : "atc-1hz" (from $SZLIB_DATA_DIR, or downloaded once into the user's cache), or paths: files,
        folders of track files, or globs.

    Raises DataError where there is no such file, a download fails, or a hash does not match.
    """
    if data == ATC_1HZ:
        return _atc_1hz()
    names = [data] if isinstance(data, str | Path) else list(data)
    files = [file for name in names for file in _expand(name)]
    if not files:
        raise DataError("no data was named; expected 'synthetic', 'atc-1hz', or paths of track files")
    return files


def label(data: str | Path | Sequence[str | Path]) -> str:
    """A short name for a data set, fit for a folder: "synthetic", "atc-1hz", or the first file's."""
    if isinstance(data, str | Path):
        return (
            str(data)
            if data in (SYNTHETIC, ATC_1HZ)
            else Path(data).name.split(".")[0].strip("*?[]") or "files"
        )
    return label(data[0]) + (f"-and-{len(data) - 1}-more" if len(data) > 1 else "")


def _atc_1hz() -> list[Path]:
    folder = os.environ.get(DATA_DIR_VARIABLE)
    if folder:
        return [_verified(Path(folder) / ATC_1HZ / name, sha256) for name, sha256 in ATC_1HZ_FILES.items()]
    store = pooch.create(
        path=pooch.os_cache("szlib") / ATC_1HZ,
        base_url=ATC_1HZ_URL,
        registry={name: f"sha256:{sha256}" for name, sha256 in ATC_1HZ_FILES.items()},
        retry_if_failed=2,
    )
    try:
        return [Path(store.fetch(name, progressbar=True)) for name in ATC_1HZ_FILES]
    except (OSError, ValueError) as error:  # requests' errors are OSErrors; ValueError: wrong hash
        raise DataError(
            f"the ATC day could not be downloaded from {ATC_1HZ_URL} ({error}); go online, or put its "
            f"files into a folder {ATC_1HZ}/ and name its parent in ${DATA_DIR_VARIABLE}"
        ) from error


def _verified(file: Path, sha256: str) -> Path:
    if not file.is_file():
        raise DataError(
            f"{file}: no such file; ${DATA_DIR_VARIABLE} must name a folder with {ATC_1HZ}/ in it"
        )
    found = pooch.file_hash(str(file))
    if found != sha256:
        raise DataError(
            f"{file}: SHA-256 is {found}, expected {sha256}; the file is damaged or another version"
        )
    return file


def _expand(name: str | Path) -> list[Path]:
    path = Path(name)
    if path.is_dir():
        files = sorted(file for file in path.iterdir() if file.is_file() and not file.name.startswith("."))
    elif path.is_file():
        files = [path]
    else:
        files = sorted(Path(path.anchor).glob(str(path.relative_to(path.anchor))))
    if not files:
        raise DataError(
            f"{name}: no such file; expected 'synthetic', 'atc-1hz', or a file, folder or glob of tracks"
        )
    return files
