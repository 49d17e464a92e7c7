"""Named data and paths: a real day of the ATC mall, ten days of its middle, or anybody's own files.

The real day is the public 1 Hz version of 2012-10-24, pinned to a commit and to the SHA-256 of each
file; the ten days (2012-10-24 to 2012-11-25) are those of LaCE-LHMP, pinned to the git blob id of each.
The ATC data are free for research; cite Brscic, Kanda, Ikeda, Miyashita, "Person tracking in large public
spaces using 3-D range sensors", IEEE Trans. Human-Machine Systems 43(6), 2013.
"""

from __future__ import annotations

import hashlib
import os
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pooch

from ..errors import DataError, DataWarning
from ..files import printable

SYNTHETIC, ATC_1HZ, ATC_10_DAYS = NAMES = "synthetic", "atc-1hz", "atc-10-days"
_NAMED = ", ".join(map(repr, NAMES))

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
"""SHA-256 by file name; of hour 12 it holds one file of two (10 % of the people)."""

ATC_10_DAYS_URL = (
    "https://raw.githubusercontent.com/test-bai-cpu/LaCE-LHMP/"
    "ef93d1265ab26cb0a3084dc2e267579b11614607/atc_data/middle_area/"
)
ATC_10_DAYS_FILES = {
    "1024.csv": "0c7f0c52acc32fc37123141de8ce0b0bbb38100d",
    "1028.csv": "9134485ddbbfe33cecc15ce270f2701b775518eb",
    "1031.csv": "0ce3bb618010b42b3fd76dc304a565935da14dfc",
    "1104.csv": "f0fd4ed646eaf0b7a7a3dea00ab67cff93c15bbd",
    "1107.csv": "3344339024435db3af087f241f276cc1f92f41cf",
    "1111.csv": "e10ba2d846173e656f72063445523db8c49a06f0",
    "1114.csv": "85c35753fb305aceb260594164f54812219bc1ce",
    "1118.csv": "0ecf1a76874e0302d3dcf3b25b83434c12d61597",
    "1121.csv": "86379d439702e42f65084c01e59c4700123cd18d",
    "1125.csv": "f7e867b909e23b87e5850b328856be3ddf521fcd",
}
"""Git blob id by file name, month and day of 2012; x from -25 to 0 m and y from -10 to 15 m, which holds the
square; its times may count from the start of the day."""

DATA_DIR_VARIABLE = "SZLIB_DATA_DIR"
"""A folder that holds `atc-1hz/` or `atc-10-days/`, to be used instead of the network."""

_LONGEST_LABEL = 60
_ATTEMPTS = 3
"""A file whose content is not the right one is fetched so often."""


def find(data: str | Path | Sequence[str | Path]) -> list[Path]:
    """The files of a data set.

    Parameters
    ----------
    data : "atc-1hz" or "atc-10-days" (from $SZLIB_DATA_DIR, or downloaded once into the user's cache), or
        paths: files, folders of track files, or globs.

    Raises DataError where there is no such file, a download fails, or a hash does not match.
    """
    if data == ATC_1HZ:
        return _named(ATC_1HZ, ATC_1HZ_URL, ATC_1HZ_FILES, pooch.file_hash)
    if data == ATC_10_DAYS:
        return _named(ATC_10_DAYS, ATC_10_DAYS_URL, ATC_10_DAYS_FILES, git_blob_id)
    names = [data] if isinstance(data, str | Path) else list(data)
    files = [file for name in names for file in _expand(name)]
    if not files:
        raise DataError(f"no data was named; expected {_NAMED}, or paths of track files")
    return files


def label(data: str | Path | Sequence[str | Path]) -> str:
    """A short name for a data set, fit for a folder: one of `NAMES`, or the first file's."""
    if isinstance(data, str | Path):
        if data in NAMES:
            return str(data)
        name = Path(os.path.abspath(data)).name.split(".")[0]  # noqa: PTH100 - links keep their names
        name = re.sub(r"[^\w+-]+", "-", name).strip("-")
        return name[:_LONGEST_LABEL] or "files"
    return label(data[0]) + (f"-and-{len(data) - 1}-more" if len(data) > 1 else "")


def git_blob_id(file: str | Path) -> str:
    """The name that git gives to a file's content: SHA-1 of "blob", its size, a zero byte, and itself."""
    digest = hashlib.sha1(f"blob {Path(file).stat().st_size}\0".encode(), usedforsecurity=False)
    with Path(file).open("rb") as stream:
        while block := stream.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def _named(name: str, url: str, files: Mapping[str, str], content: Callable[[str], str]) -> list[Path]:
    """The files of a named data set, each with the right hash of its content."""
    folder = os.environ.get(DATA_DIR_VARIABLE)
    if folder:
        return [_verified(Path(folder) / name / file, right, content) for file, right in files.items()]
    home = pooch.os_cache("szlib") / name
    store = pooch.create(path=home, base_url=url, registry=dict.fromkeys(files), retry_if_failed=2)
    try:
        return [_fetched(store, file, right, content) for file, right in files.items()]
    except OSError as error:  # requests' errors are OSErrors
        raise DataError(
            f"{name} could not be downloaded from {url} ({error}); go online, or put its files into a "
            f"folder {name}/ and name its parent in ${DATA_DIR_VARIABLE}"
        ) from error


def _fetched(store: pooch.Pooch, name: str, right: str, content: Callable[[str], str]) -> Path:
    """A file from the cache, or downloaded into it; what is not right does not stay there."""
    for _ in range(_ATTEMPTS):
        file = Path(store.fetch(name, progressbar=True))
        if (found := content(str(file))) == right:
            return file
        file.unlink()
    raise OSError(f"{name}: its hash is {found}, expected {right}")


def _verified(file: Path, right: str, content: Callable[[str], str]) -> Path:
    if not file.is_file():
        raise DataError(
            f"{file}: no such file; ${DATA_DIR_VARIABLE} must name a folder with {file.parent.name}/ in it"
        )
    found = content(str(file))
    if found != right:
        kind = "git blob id" if content is git_blob_id else "SHA-256"
        raise DataError(
            f"{file}: {kind} is {found}, expected {right}; the file is damaged or another version"
        )
    return file


def _expand(name: str | Path) -> list[Path]:
    """The regular files that a path stands for; a FIFO or a device would be read for ever."""
    path = Path(name)
    try:
        if path.is_dir():
            found = [file for file in path.iterdir() if not file.name.startswith(".")]
        elif path.exists() or path.is_symlink():
            if not path.is_file():
                raise DataError(
                    f"{printable(name)}: is no regular file (or leads nowhere); only those are read"
                )
            return [path]
        else:
            found = list(Path(path.anchor).glob(str(path.relative_to(path.anchor))))
    except (OSError, ValueError, NotImplementedError, IndexError, re.error) as error:
        if isinstance(error, DataError):
            raise
        raise DataError(
            f"{printable(name)}: cannot be looked up ({error}); expected {_NAMED}, or paths"
        ) from error
    files = sorted(file for file in found if file.is_file())
    if not files:
        raise DataError(
            f"{printable(name)}: no such file; expected {_NAMED}, or a file, folder or glob of tracks"
        )
    others = sum(not file.is_file() and not (path.is_dir() and file.is_dir()) for file in found)
    if others:
        warnings.warn(
            f"{printable(name)}: left out what is no regular file: {others} x folder or other", DataWarning,
            stacklevel=4,
        )  # fmt: skip
    return files
