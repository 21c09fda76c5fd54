"""Options about a transcript mean the same in every command that takes one."""

from __future__ import annotations

from pathlib import Path

import pytest
import soundfile

from cospeech.cli.demo import EXAMPLE

SRT = "1\n{hour:02d}:00:00,200 --> {hour:02d}:00:00,900\nthat huge\n"
COMMANDS = (
    ["generate", "talk.wav", "-o", "x.json", "-q"],
    ["robot", "talk.wav", "x.csv", "-q"],
    ["dialogue", "talk.wav", "other.wav", "-o", "x.{name}.json", "--transcript", "late.srt", "-q"],
    ["stream", "-i", "talk.wav", "--to", "-", "--unpaced", "-q"],
)


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A working folder with a speech, the words of it, and the same words with the clock of a broadcast."""
    monkeypatch.chdir(tmp_path)
    sound, rate = soundfile.read(EXAMPLE, frames=2 * 48_000, dtype="float32")
    soundfile.write("talk.wav", sound[:rate], rate)
    soundfile.write("other.wav", sound[rate : 2 * rate], rate)
    Path("talk.srt").write_text(SRT.format(hour=0), "utf-8", newline="\n")
    Path("late.srt").write_text(SRT.format(hour=1), "utf-8", newline="\n")
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("line", COMMANDS, ids=lambda line: line[0])
def test_an_offset_moves_the_words_in_every_command(cli, place, line):
    for options, message in (([], "(its clock begins at 01:00:00"), (["--transcript-offset", "-1:00:10"], "ends at -9.1 s")):
        code, _, err = cli(*line, "--transcript", "late.srt", *options)
        assert code == 2
        assert message in err
    assert not list(place.glob("x.*"))
    assert cli(*line, "--transcript", "late.srt", "--transcript-offset", "-3600")[::2] == (0, "")


@pytest.mark.slow
def test_words_with_an_offset_give_the_motion_of_words_in_time(cli, place):
    for name, more in (("talk", ()), ("late", ("--transcript-offset", "-1:00:00")), ("{name}", ("--transcript-offset", "0.0"))):
        out = name.replace("{name}", "each")
        assert cli("generate", "talk.wav", "-o", f"{out}.json", "--transcript", f"{name}.srt", *more, "-q") == (0, "", "")
    assert cli("generate", "talk.wav", "-o", "none.json", "-q") == (0, "", "")
    late = Path("late.json").read_bytes()
    assert late == Path("talk.json").read_bytes() == Path("each.json").read_bytes() != Path("none.json").read_bytes()
    Path("other.srt").write_bytes(Path("late.srt").read_bytes())
    Path("talk.srt").write_bytes(Path("late.srt").read_bytes())
    line = ["generate", "talk.wav", "other.wav", "-o", "all/{name}.json", "--transcript", "{name}.srt", "-q"]
    assert cli(*line, "--transcript-offset", "-3600") == (0, "", "")
    assert Path("all/talk.json").read_bytes() == late


@pytest.mark.parametrize(
    "line",
    [*COMMANDS[:2], COMMANDS[3], ["dialogue", "talk.wav", "other.wav", "-o", "{name}.json"]],
    ids=lambda line: line[0],
)
def test_an_offset_or_a_tier_without_a_transcript_is_told(cli, place, line):
    for flag in ("--transcript-offset", "--transcript-tier"):
        code, _, err = cli(*line, flag, "2")
        assert code == 2
        assert err.splitlines()[-1].startswith(f"error: {flag} without --transcript (")


GRID = """File type = "ooTextFile"
Object class = "TextGrid"
0 1 <exists> 2
"IntervalTier" "talk" 0 1 1  .2 .9 "that huge"
"IntervalTier" "other" 0 1 1  .1 .8 "not me"
"""


@pytest.mark.slow
@pytest.mark.parametrize("line", COMMANDS, ids=lambda line: line[0])
def test_a_tier_is_named_in_every_command(cli, place, line):
    Path("all.TextGrid").write_text(GRID, "utf-8", newline="\n")
    line = [word if word != "late.srt" else "all.TextGrid" for word in line] + ["--transcript", "all.TextGrid"]
    code, _, err = cli(*line, "--transcript-tier", "talks")
    assert code == 2
    assert "(did you mean" in err
    assert err.rstrip().endswith("known: talk, other)")
    tier = "{name}" if line[0] in ("generate", "dialogue") else "talk"
    assert cli(*line, "--transcript-tier", tier)[::2] == (0, "")


@pytest.mark.slow
def test_each_person_or_speech_has_a_tier_of_one_file(cli, place):
    for name, words in (("talk", ".2\t.9\tthat huge\n"), ("other", ".1\t.8\tnot me\n")):
        Path(f"{name}.tsv").write_text(words, "utf-8", newline="\n")
    Path("all.TextGrid").write_text(GRID, "utf-8", newline="\n")
    for command in ("generate", "dialogue"):
        line = [command, "talk.wav", "other.wav", "-q", "--transcript"]
        assert cli(*line, "{name}.tsv", "-o", f"a/{command}.{{name}}.json") == (0, "", "")
        tiers = ["--transcript-tier", "{name}"]
        assert cli(*line, "all.TextGrid", *tiers, "-o", f"b/{command}.{{name}}.json") == (0, "", "")
    tiers = ["--transcript-tier", "talk", "--transcript-tier", "other"]
    assert cli("dialogue", *line[1:], "all.TextGrid", *tiers, "-o", "b/two.{name}.json") == (0, "", "")
    for file in place.glob("a/*.json"):
        assert file.read_bytes() == (place / "b" / file.name).read_bytes()
    assert Path("b/two.other.json").read_bytes() == Path("a/dialogue.other.json").read_bytes()


def test_an_offset_that_is_no_time_is_told(cli, place):
    code, _, err = cli("generate", "talk.wav", "-o", "x.json", "--transcript", "talk.srt", "--transcript-offset", "-soon")
    assert code == 2
    assert "'-soon' is not a number of seconds" in err
