# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
"""The batch scripts with commands of the test in place of SLURM's; test_slurm.py has a real one."""

import json
import os
import subprocess
from pathlib import Path

import pytest
from program import differences, succeed, write_case

SCRIPTS = Path(__file__).resolve().parents[3] / "scripts/slurm"
SMALL = ["--set", "grid.tile=[5, 5]"]
# Jobs are run at once, in the order of their submission, each element of an array by itself; a job whose
# dependency failed is not run.
SBATCH = """\
#!/usr/bin/env bash
state=$SCHEDULER_STATE
elements=("")
while [[ $1 == -* ]]; do
  case $1 in
  --array=1-*)
    mapfile -t elements < <(seq "${1#--array=1-}")
    export SLURM_ARRAY_TASK_COUNT=${#elements[@]}
    ;;
  --dependency=afterok:*) [[ $(< "$state/${1#--dependency=afterok:}") == 0 ]] || needed=failed ;;
  esac
  shift
done
job=$(($(ls "$state" | wc -l) + 1))
echo 0 > "$state/$job"
export SLURM_SUBMIT_DIR=$PWD SLURM_JOB_ID=$job SLURM_NTASKS=2
for element in "${elements[@]}"; do
  if [[ -n $element ]]; then export SLURM_ARRAY_TASK_ID=$element SLURM_ARRAY_JOB_ID=$job; fi
  if [[ -z ${needed:-} ]]; then bash "$@" > "job-$job-$element.log" 2>&1; code=$?; else code=1; fi
  if ((code != 0)); then echo "$code" > "$state/$job"; fi
done
echo "$job"
"""
SRUN = """\
#!/usr/bin/env bash
while [[ $1 == -* ]]; do shift; done
exec "$@"
"""
SCONTROL = """\
#!/usr/bin/env bash
echo "$@" >> scontrol.txt
"""
SLEEP = """\
#!/usr/bin/env bash
"""


@pytest.fixture
def scheduler(separatrix: Path, tmp_path: Path) -> dict[str, str]:
    """The environment in which scripts find these commands."""
    commands, state = tmp_path / "commands", tmp_path / "state"
    commands.mkdir()
    state.mkdir()
    for name, text in {"sbatch": SBATCH, "srun": SRUN, "scontrol": SCONTROL, "sleep": SLEEP}.items():
        (commands / name).write_text(text)
        (commands / name).chmod(0o755)
    work = tmp_path / "work"
    work.mkdir()
    write_case(work)
    return os.environ | {
        "PATH": f"{commands}:{os.environ['PATH']}",
        "SCHEDULER_STATE": str(state),
        "SEPARATRIX": str(separatrix),
        "SEPARATRIX_ROOT": str(SCRIPTS.parents[1]),
    }


def submit(scheduler: dict[str, str], folder: Path, *arguments: str) -> list[str]:
    """The codes of the jobs that were submitted."""
    ended = subprocess.run(
        [SCRIPTS / arguments[0], *arguments[1:]], cwd=folder, env=scheduler, capture_output=True, text=True
    )
    assert ended.returncode == 0, ended.stderr
    state = Path(scheduler["SCHEDULER_STATE"])
    return [(state / job).read_text().strip() for job in ended.stdout.split()]


def test_an_array_searches_once_and_is_merged(scheduler, separatrix, tmp_path):
    work = tmp_path / "work"
    codes = submit(scheduler, work, "submit_array.sh", "--ntasks=1", "--", "3", "case.toml", "map.h5", *SMALL)
    assert codes == ["0", "0", "0"], [path.read_text() for path in work.glob("job-*.log")]
    succeed(separatrix, "basin", "case.toml", *SMALL, "-o", "whole.h5", folder=work)
    assert differences(work / "whole.h5", work / "map.h5") == []
    assert list(work.glob("*.part")) == []
    found = {}
    for path in work.glob("*.log.jsonl"):
        lines = [json.loads(line) for line in path.read_text().splitlines()]
        (found[path.name],) = [line["message"] for line in lines if line["event"] == "catalogue"]
    assert found.pop("map.h5.search.log.jsonl").endswith(" discovered")
    assert len(found) == 3
    assert all(message.endswith(" taken from map.h5.shard-1-of-3.part") for message in found.values())


def test_an_array_without_its_search_is_not_begun(scheduler, separatrix, tmp_path):
    work = tmp_path / "work"
    wrong = ["--set", "axis[1].count=-1"]
    codes = submit(scheduler, work, "submit_array.sh", "--", "2", "case.toml", "map.h5", *wrong)
    assert codes == ["65", "1", "1"]
    one = scheduler | {
        "SLURM_ARRAY_TASK_ID": "1",
        "SLURM_ARRAY_TASK_COUNT": "2",
        "SLURM_SUBMIT_DIR": str(work),
    }
    ended = subprocess.run(
        [SCRIPTS / "array.sh", "case.toml", "map.h5"], cwd=work, env=one, capture_output=True, text=True
    )
    assert ended.returncode == 66 and "search.sh" in ended.stderr
    assert list(work.glob("map.h5*.part")) == []


def test_a_stopped_job_comes_again_unless_it_got_nowhere(scheduler, separatrix, tmp_path):
    work = tmp_path / "work"
    alone = scheduler | {"SLURM_JOB_ID": "7", "SLURM_SUBMIT_DIR": str(work)}
    slow = ["--set", "grid.tile=[4, 4]", "--set", "axis[1].count=400", "--set", "axis[2].count=400"]
    slow += ["--set", "integrator.lanes='off'", "--set", "run.stop='duration'", "--set", "run.duration=100"]
    # Time for the search and some tiles, but by far not for all.
    for limit, again in (("4", True), ("1e-6", False)):
        command = [SCRIPTS / "srun.sh", "case.toml", "map.h5", *slow, "--time-limit", limit]
        ended = subprocess.run(command, cwd=work, env=alone, capture_output=True, text=True)
        assert ended.returncode == 75, ended
        assert ("goes into the queue again" in ended.stdout) == again
        assert ("no tile was finished" in ended.stderr) == (not again)
    assert (work / "scontrol.txt").read_text() == "requeue 7\n"


def test_a_launch_that_fails_is_tried_again_a_few_times(scheduler, tmp_path):
    """Killed ranks, a broken node: no code of the program. Its own codes end the job at once."""
    work = tmp_path / "work"
    alone = scheduler | {"SLURM_JOB_ID": "7", "SLURM_SUBMIT_DIR": str(work), "SEPARATRIX_RETRIES": "2"}
    program = tmp_path / "program"

    def launch(code: int) -> tuple[int, bool]:
        program.write_text(
            f"#!/usr/bin/env bash\n[[ $1 == info ]] || exit {code}\necho '\"tiles_done\": 5'\n"
        )
        program.chmod(0o755)
        (work / "scontrol.txt").unlink(missing_ok=True)
        command = [SCRIPTS / "srun.sh", "case.toml", "map.h5"]
        environment = alone | {"SEPARATRIX": str(program)}
        ended = subprocess.run(command, cwd=work, env=environment, capture_output=True, text=True)
        return ended.returncode, (work / "scontrol.txt").exists()

    assert [launch(137) for _ in range(3)] == [(137, True), (137, True), (137, False)]
    assert not (work / "map.h5.part.tiles").exists()
    # A new tile begins the count again.
    (work / "map.h5.part").touch()
    (work / "map.h5.part.tiles").write_text("4 2\n")
    assert [launch(1) for _ in range(3)] == [(1, True), (1, True), (1, False)]
    for code in (0, 65, 73, 74, 76, 78):
        assert launch(code) == (code, False)


def test_a_search_that_fails_to_launch_is_tried_again(scheduler, tmp_path):
    work = tmp_path / "work"
    alone = scheduler | {"SLURM_JOB_ID": "7", "SLURM_SUBMIT_DIR": str(work), "SEPARATRIX": "false"}
    command = [SCRIPTS / "search.sh", "3", "case.toml", "map.h5"]
    ended = subprocess.run(command, cwd=work, env=alone, capture_output=True, text=True)
    assert ended.returncode == 1
    assert (work / "scontrol.txt").read_text() == "requeue 7\n"
