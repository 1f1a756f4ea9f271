"""The archive behind the download button: made by a process of low priority."""

import os
import subprocess
import sys

import pytest

from server.settings import ROOT

_SAY = """
import os
from server.commands.export_archive import give_way
give_way()
print(os.sched_getscheduler(0), os.nice(0))
"""


@pytest.mark.skipif(not hasattr(os, "SCHED_IDLE"), reason="only Linux has this scheduler")
def test_the_process_runs_at_the_lowest_priority() -> None:
    said = subprocess.run([sys.executable, "-c", _SAY], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert said.split() == [str(os.SCHED_IDLE), "19"]
