"""Forked kernels behave as any other kernel."""

import io
import os
import sys
from base64 import b64decode
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError, DeadKernelError
from PIL import Image

from szlib.workbook import forked_kernel

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="kernels are forked on Linux only"
)


def execute(folder, *codes):
    """Execute these cells in a kernel of their own; what each printed, and the types of what it showed."""
    cells = [nbformat.v4.new_code_cell(code) for code in codes]
    notebook = nbformat.v4.new_notebook(cells=cells)
    client = NotebookClient(
        notebook, kernel_name="python3", kernel_manager_class=forked_kernel.ForkedKernelManager,
        extra_arguments=["--log-level=CRITICAL"], resources={"metadata": {"path": str(folder)}},
    )  # fmt: skip
    client.execute(env=os.environ | {"WORD": "asked for"})
    outputs = [output for cell in cells for output in cell.outputs]
    return [o["text"].strip() for o in outputs if "text" in o], [
        o["data"] for o in outputs if "data" in o
    ]


def test_kernel_has_its_own_folder_environment_and_memory(tmp_path):
    look = "import os, szlib\n"
    look += "where = os.getcwd()\n"
    look += (
        "print(where, os.environ['WORD'], os.getsid(0) - os.getpid(), szlib.__name__)"
    )
    first, _ = execute(
        tmp_path, look + "\nszlib.__name__ = os.environ['WORD'] = 'changed'"
    )
    again, _ = execute(tmp_path, look)
    assert first == again == [f"{tmp_path} asked for 0 szlib"]
    assert Path.cwd() != tmp_path and "WORD" not in os.environ


def test_kernel_shows_figures_and_has_imported_szlib(tmp_path):
    loaded = "import sys\nprint('casadi' in sys.modules, 'szlib.zones.social_zone' in sys.modules)"
    draw = "import matplotlib.pyplot as plt\nplt.plot([1, 2]); plt.show()"
    printed, shown = execute(tmp_path, loaded, draw)
    assert printed == ["True True"]
    assert "image/png" in shown[-1]


def test_recorded_figure_is_shown_smaller_and_once(tmp_path):
    record = "from szlib.workbook.record import NotebookRecord\n"
    parameters = {"data": "synthetic", "results": str(tmp_path / "out")}
    record += f"record = NotebookRecord('99_test', {parameters})"
    draw = "import matplotlib.pyplot as plt\nfig, ax = plt.subplots()\nax.set_title('a line')\n"
    _, (shown,) = execute(tmp_path, record, draw + "record.figure(fig, 'line')")
    (saved,) = tmp_path.rglob("99_test-line.png")
    small, large = (
        Image.open(io.BytesIO(b64decode(shown["image/png"]))),
        Image.open(saved),
    )
    assert small.width == round(large.width * 2 / 3)
    small, large = (
        np.asarray(each.convert("L").resize((60, 50)), float) for each in (small, large)
    )
    assert np.abs(small - large).mean() < 2


def test_notebook_refuses_a_parameter_that_papermill_sets_and_it_does_not_know(
    tmp_path,
):
    own = f"data = 'synthetic'\ngamma = 0.05\nresults = {str(tmp_path / 'out')!r}"
    record = "from szlib.workbook.record import NotebookRecord\nNotebookRecord('99_test', globals())"
    execute(tmp_path, own, "# Parameters\ngamma = 0.1\nr_max = 1.5\n", record)
    with pytest.raises(
        CellExecutionError,
        match="unknown parameter gama; the notebook knows data, gamma",
    ):
        execute(tmp_path, own, "# Parameters\ngama = 0.1\n", record)


def test_kernel_can_be_interrupted_and_killed(tmp_path):
    stop = "import os, signal, time\ntry:\n    os.kill(os.getpid(), signal.SIGINT)\n    time.sleep(60)\n"
    printed, _ = execute(
        tmp_path, stop + "except KeyboardInterrupt:\n    print('stopped')"
    )
    assert printed == ["stopped"]
    with pytest.raises(DeadKernelError):
        execute(tmp_path, "import os\nos.kill(os.getpid(), 9)")
