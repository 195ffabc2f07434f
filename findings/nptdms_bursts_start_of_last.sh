#!/usr/bin/env bash
# SPDX-FileCopyrightText: The Separatrix developers
# SPDX-License-Identifier: GPL-3.0-or-later
#
# npTDMS 1.13.0, a waveform that a trigger recorded in two bursts: two segments of the same channel, each with its own
# wf_start_time, 3 s apart.
#
# Guess before trying: the gap is lost, as the track of times has one start and one step; that start is the first burst's.
# Seen: the start is the last burst's. The absolute times of the first burst, too, begin 3 s after it was recorded, and its samples
# are followed by those of the second without a gap. `properties` has the last start only. There is no warning. The starts of
# all bursts are in the lead-ins of the file.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check npTDMS==1.13.0 numpy==2.4.6
cd "$folder"
venv/bin/python -W error > seen.txt << 'PYTHON'
from importlib.metadata import version

import numpy as np
from nptdms import ChannelObject, TdmsFile, TdmsWriter

starts = ["2024-05-01T10:00:00", "2024-05-01T10:00:03"]
with TdmsWriter("bursts.tdms") as writer:
    for start in starts:
        waveform = {
            "wf_start_time": np.datetime64(start), "wf_increment": 0.001, "wf_start_offset": 0.0, "wf_samples": 4,
        }
        writer.write_segment([ChannelObject("hammer", "force", np.arange(4.0), properties=waveform)])
channel = TdmsFile.read("bursts.tdms")["hammer"]["force"]
absolute = channel.time_track(absolute_time=True, accuracy="ms")
print("npTDMS", version("npTDMS"))
print("recorded from", *starts)
print("relative:", *channel.time_track())
print("absolute, first of burst 1:", absolute[0])
print("absolute, first of burst 2:", absolute[4])
print("wf_start_time:", channel.properties["wf_start_time"])
PYTHON
cat seen.txt
diff seen.txt - << 'EXPECTED'
npTDMS 1.13.0
recorded from 2024-05-01T10:00:00 2024-05-01T10:00:03
relative: 0.0 0.001 0.002 0.003 0.004 0.005 0.006 0.007
absolute, first of burst 1: 2024-05-01T10:00:03.000000
absolute, first of burst 2: 2024-05-01T10:00:03.004000
wf_start_time: 2024-05-01T10:00:03.000000
EXPECTED
