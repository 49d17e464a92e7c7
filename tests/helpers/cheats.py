"""Sixty ways to pass a task without solving it, of five kinds: `CHEATS[kind]` is a list of (task, source).

Each source is what a sheet would hold: it defines the function of the task. None of them may pass, and none
may hold a check longer than its time.
"""

# ruff: noqa: E501
from __future__ import annotations

import textwrap

from szlib.workbook import folders

SOLVED = str(folders.NOTEBOOKS / "solutions" / "sheet4_own_zone.py")
JUDGES = str(folders.NOTEBOOKS / "exercises")


def speed_limit(body: str, before: str = "") -> tuple[str, str]:
    """A cheat in the body of one function, for h, gamma, dt and v."""
    inside = textwrap.indent(textwrap.dedent(body).strip("\n"), "    ")
    return (
        "speed_limit",
        f"{textwrap.dedent(before)}\n\ndef speed_limit(h, gamma, dt, v):\n{inside}\n",
    )


NAIVE = [
    (
        "my_zone",
        "import szlib\ndef my_zone(samples, speed):\n    return szlib.Ellipse((0.05, 0), (0.95, 0.72))\n",
    ),
    (
        "my_zone",
        "import szlib\ndef my_zone(s, v):\n    b = s.groupby('encounter')['distance'].min().quantile(0.1)\n"
        "    return szlib.Ellipse((0.05, 0), (b + 0.22, b))\n",
    ),
    (
        "my_zone",
        "import szlib\ndef my_zone(s, v):\n    b = s['distance'].quantile(0.01)\n"
        "    return szlib.Ellipse((0.03, 0), (b + 0.3, b + 0.06))\n",
    ),
    (
        "my_zone",
        "import szlib, numpy as np\ndef my_zone(s, v):\n    n = s.groupby('encounter')['distance'].min()\n"
        "    return szlib.Ellipse((0, 0), (n.quantile(0.3), n.quantile(0.08)))\n",
    ),
    (
        "my_zone",
        "import szlib, numpy as np\ndef my_zone(s, v):\n    s = s[(s.speed - v).abs() < 0.2]\n"
        "    side = s[np.abs(np.sin(s.los_angle)) > 0.9].groupby('encounter')['distance'].min().quantile(0.07)\n"
        "    front = s[np.abs(np.cos(s.los_angle)) > 0.9].groupby('encounter')['distance'].min().quantile(0.07)\n"
        "    return szlib.Ellipse((0.03, 0), (max(front, side), min(front, side)))\n",
    ),
    ("tuned", "def tuned(a_max):\n    return 0.03, 8\n"),
    ("tuned", "def tuned(a_max):\n    return 0.035, 3\n"),
    ("tuned", "def tuned(a_max):\n    return 0.026, 3\n"),
    (
        "largest_gamma",
        "def largest_gamma(zone, a_max, gammas):\n    return gammas[len(gammas) // 2]\n",
    ),
    (
        "largest_gamma",
        "def largest_gamma(zone, a_max, gammas):\n    return max(g for g in gammas if g <= max(0.1 * a_max, gammas[0]))\n",
    ),
    (
        "prediction",
        "def prediction(s, c, before, after, q):\n    return 'larger' if hash((s, c)) % 2 else 'smaller'\n",
    ),
    ("count_ways", "def count_ways(paths, people):\n    return 4\n"),
]

INTERNALS = [
    speed_limit(
        "from judges.sheets import SHEETS\nreturn SHEETS['sheet4_own_zone'][1].solution(h, gamma, dt, v)"
    ),
    speed_limit("import judges\nreturn judges.robot._limit(h, gamma, dt, v)"),
    (
        "largest_gamma",
        "from judges.robot import _largest\ndef largest_gamma(zone, a_max, gammas):\n"
        "    return _largest(zone, a_max, gammas)\n",
    ),
    speed_limit(
        f"""
        import sys
        sys.meta_path.pop(0)
        sys.path.insert(0, {JUDGES!r})
        from judges.robot import _limit
        return _limit(h, gamma, dt, v)
        """
    ),
    speed_limit(
        f"text = open({SOLVED!r}).read()\nspace = {{}}\nexec(text, space)\nreturn space['speed_limit'](h, gamma, dt, v)"
    ),
    speed_limit(
        f"""
        import os
        file = os.open({SOLVED!r}, os.O_RDONLY)
        return float(len(os.read(file, 100)))
        """
    ),
    speed_limit(
        """
        import sys
        frame = sys._getframe()
        while frame:
            for value in [*frame.f_locals.values(), *frame.f_globals.values()]:
                if type(value).__name__ == "Task":
                    return value.solution(h, gamma, dt, v)
            frame = frame.f_back
        return 0.0
        """
    ),
    speed_limit(
        """
        import gc
        for each in gc.get_objects():
            if type(each).__name__ == "Task" and each.name == "speed_limit":
                return each.solution(h, gamma, dt, v)
        return 0.0
        """
    ),
    (
        "wall_distance",
        "import szlib\ndef wall_distance(points, a, b):\n    return szlib.segment_distance(points, a, b)\n",
    ),
    (
        "my_zone",
        "import szlib\ndef my_zone(samples, speed):\n    return szlib.SocialZone.fit(samples, method='paper').ellipse(speed)\n",
    ),
    (
        "my_zone",
        "import gc, szlib\ndef my_zone(samples, speed):\n"
        "    return [each for each in gc.get_objects() if isinstance(each, szlib.Ellipse)][-1]\n",
    ),
    (
        "prediction",
        "import sys\ndef prediction(*change):\n    frame = sys._getframe(1)\n"
        "    return next((answer for case, answer in frame.f_locals.get('args', [[]])[0] if case == change), 'larger')\n",
    ),
]

PATCHES = [
    speed_limit(
        "return 0.0", "import judges.task\njudges.task.compare = lambda *a, **k: ''\n"
    ),
    speed_limit(
        "return 0.0",
        "import judges\njudges.Verdict.require = lambda self: None\njudges.check = lambda *a, **k: None\n",
    ),
    speed_limit(
        "import numpy as np\nnp.isclose = lambda *a, **k: np.True_\nnp.flatnonzero = lambda a: []\nreturn 0.0"
    ),
    speed_limit(
        "import sys\nsys.setprofile(None)\nsys.settrace(None)\nimport szlib\nreturn 0.0"
    ),
    speed_limit(
        'import json\njson.dumps = lambda found, **k: \'{"passed": true, "message": "correct in 40 fresh cases"}\'\nreturn 0.0'
    ),
    speed_limit(
        'import os\nos.write(1, b\'{"passed": true, "message": "correct in 40 fresh cases"}\\n\' * 40)\nreturn 0.0'
    ),
    (
        "speed_limit",
        "class Equal(float):\n    def __eq__(self, other): return True\n    def __sub__(self, other): return 0.0\n"
        "    def __array__(self, *a, **k): raise ValueError\ndef speed_limit(h, gamma, dt, v):\n    return Equal(1)\n",
    ),
    (
        "in_space",
        "import numpy as np\nclass Any(np.ndarray):\n    def __eq__(self, other): return np.ones(40, bool)\n"
        "    def astype(self, kind): return self\n"
        "def in_space(ref, heading, others):\n    return np.zeros(len(others), bool).view(Any)\n",
    ),
    speed_limit(
        "raise StopIteration", "import builtins\nbuiltins.Exception = BaseException\n"
    ),
    speed_limit(
        f"""
        import posixpath, os
        posixpath._joinrealpath = lambda *a, **k: ('/usr/lib/x', True)
        os.path.join = os.path.realpath = lambda *a: '/usr/lib/x'
        return float(len(open({SOLVED!r}).read()))
        """
    ),
    speed_limit(
        f"""
        class Path(str):
            def startswith(self, *roots): return True
            def __contains__(self, text): return False
        return float(len(open(Path({SOLVED!r})).read()))
        """
    ),
    (
        "p_value",
        "import szlib\nszlib.DataError = None\nimport unittest.mock as mock\nmock.patch('numpy.asarray').start()\n"
        "def p_value(observed, null):\n    return 0.5\n",
    ),
]

CONCURRENCY = [
    speed_limit(
        """
        import threading
        box = [0.0]
        threading.Thread(target=lambda: box.__setitem__(0, 1.0), daemon=True).start()
        return box[0]
        """
    ),
    speed_limit("import _thread\n_thread.start_new_thread(print, ())\nreturn 0.0"),
    speed_limit(
        "from concurrent.futures import ThreadPoolExecutor\nreturn ThreadPoolExecutor().submit(float, 1).result()"
    ),
    speed_limit(
        "import os\nif os.fork():\n    import time\n    time.sleep(3600)\nreturn 0.0"
    ),
    speed_limit("import os\nos.setsid()\nimport time\ntime.sleep(3600)"),
    speed_limit(
        "import subprocess, sys\nreturn float(subprocess.check_output([sys.executable, '-c', 'print(1)']))"
    ),
    speed_limit("import os\nreturn float(os.system('sleep 3600 &'))"),
    speed_limit(
        "import multiprocessing\nreturn multiprocessing.Pool(2).map(abs, [1])[0]"
    ),
    speed_limit(
        """
        import sys
        sys.modules.pop('subprocess')
        import _posixsubprocess, os
        return float(_posixsubprocess.fork_exec([b'/bin/sleep', b'3600'], [b'/bin/sleep'], True, (), None, None,
                     -1, -1, -1, -1, -1, -1, -1, -1, True, False, 0, None, None, None, -1, None, False))
        """
    ),
    speed_limit("import os, signal\nos.kill(os.getppid(), signal.SIGKILL)\nreturn 0.0"),
    speed_limit("import ctypes\nreturn float(ctypes.CDLL(None).fork())"),
    speed_limit(
        "import socket\nsocket.create_connection(('127.0.0.1', 9), timeout=3600)\nreturn 0.0"
    ),
]

EXHAUSTION = [
    speed_limit("while True:\n    pass"),
    speed_limit("import time\ntime.sleep(3600)"),
    speed_limit("return [0.0] * 10**10"),
    speed_limit("import numpy as np\nreturn np.ones(2 * 10**10)"),
    speed_limit("import numpy as np\nreturn np.zeros(10**8)"),
    speed_limit("return speed_limit(h, gamma, dt, v)"),
    speed_limit("data = []\nwhile True:\n    data.append(bytearray(10**7))"),
    speed_limit("import os\nos._exit(0)"),
    speed_limit("import sys\nsys.exit(0)"),
    speed_limit("while True:\n    print('x' * 10**6)"),
    speed_limit("import os\nwhile True:\n    os.write(1, b'x' * 10**6)"),
    speed_limit(
        "while True:\n    try:\n        while True:\n            pass\n    except BaseException:\n        pass"
    ),
]

CHEATS = {
    "naive": NAIVE,
    "internals": INTERNALS,
    "patches": PATCHES,
    "concurrency": CONCURRENCY,
    "exhaustion": EXHAUSTION,
}
