"""``freqid campaign``: its file, table, page and progress, and going on after a kill."""

import json
import os
import signal
import subprocess
import sys
import time

import pandas as pd

PLAN = 'stage = "own.py:trial"\nseeds = 30\nbatch = 1\n[vary]\nsize = [0.0, 1.0]\n'
OWN = """
import time
def trial(seed, *, size):
    time.sleep({pause})
    return {{"value": seed * size, "quantity": "product", "present": size > 0, "called": seed % 4 == 0}}
"""


def write(folder, pause=0.0):
    (folder / "own.py").write_text(OWN.format(pause=pause))
    (folder / "c.toml").write_text(PLAN)
    return folder / "c.toml"


def test_a_campaign_leaves_rows_a_result_and_a_page(freqid, tmp_path):
    code, out, err = freqid("campaign", write(tmp_path), "--jobs", "1", "-o", tmp_path / "out")
    assert code == 0
    assert "60 cases, 0 without a result, 60 rows" in out
    assert "26.7 %" in out  # 8 of 30 seeds are multiples of four
    assert "60 cases in 60 units" in err
    assert "60 of 60 cases" in err
    page = (tmp_path / "out" / "index.html").read_text()
    assert "Campaign of 60 cases" in page
    assert "<svg" in page
    code, out, _ = freqid("campaign", tmp_path / "c.toml", "--jobs", "1", "-o", tmp_path / "out", "--json")
    assert code == 0
    said = json.loads(out)
    assert (said["cases"], said["failed"]) == (60, 0)
    code, out, _ = freqid("report", tmp_path / "out" / "campaign.h5", "-o", tmp_path / "again.html")
    assert code == 0
    assert (tmp_path / "again.html").read_text() == page
    code, _, err = freqid("campaign", tmp_path / "c.toml", "--axis", "seize", "-o", tmp_path / "out")
    assert code == 2
    assert "axis 'seize' does not vary" in err


def test_a_killed_campaign_resumes_to_the_same(tmp_path):
    path = write(tmp_path, pause=0.02)
    command = [sys.executable, "-m", "freqid", "campaign", str(path), "--jobs", "1", "--no-page", "-o"]
    killed = subprocess.Popen([*command, str(tmp_path / "killed")], stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline and len(list(tmp_path.glob("killed/rows/*.parquet"))) < 5:
        time.sleep(0.02)
    os.kill(killed.pid, signal.SIGKILL)
    killed.wait()
    kept = {p: p.stat().st_mtime_ns for p in tmp_path.glob("killed/rows/[0-9a-f]*.parquet")}
    assert 5 <= len(kept) < 60
    for folder in ("killed", "whole"):
        subprocess.run([*command, str(tmp_path / folder)], check=True, capture_output=True)
    assert {p: p.stat().st_mtime_ns for p in kept} == kept
    one, other = (
        pd.read_parquet(tmp_path / f / "rows").sort_values(["size", "seed"]).reset_index(drop=True)
        for f in ("killed", "whole")
    )
    pd.testing.assert_frame_equal(one, other, check_exact=True)
