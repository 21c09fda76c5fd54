"""Decode the text of a file, and refuse text that is no transcript; the errors say how to make one of it."""

from __future__ import annotations

import re
import shlex
from io import StringIO
from pathlib import Path

from ...errors import InputError

__all__ = ["check_prose", "decode", "refuse_others"]

# First bytes of sound, documents and archives that people name by mistake: WAV, AIFF, FLAC, Ogg, MP3, WebM, PDF, Word
_NO_TEXT = (b"RIFF", b"FORM", b"fLaC", b"OggS", b"ID3", b"\xff\xfb", b"\xff\xf3", b"\x1a\x45\xdf\xa3", b"%PDF-", b"PK\x03\x04")
_HEAD = 4000  # characters in which a format shows itself [ours]
_BY_FFMPEG = "make .srt of them: ffmpeg -i {name} {stem}.srt"
# How other formats begin, what they are, and what to do
_OTHERS = (
    (re.compile(r"^\[Script Info\]", re.MULTILINE), "subtitles of SubStation Alpha", _BY_FFMPEG),
    (re.compile(r"\s*+\{\d{1,9}\}\{\d{0,9}\}"), "subtitles of MicroDVD, which count frames", _BY_FFMPEG),
    (re.compile(r"\s*+<SAMI", re.IGNORECASE), "subtitles of SAMI", _BY_FFMPEG),
    (re.compile(r"Scenarist_SCC"), "captions of Scenarist", _BY_FFMPEG),
    (re.compile(r"\s*+\{\\rtf"), "rich text (RTF)", "save it as plain text"),
    (re.compile(r"\s*+(?:<!DOCTYPE\s++html|<html[\s>])", re.IGNORECASE), "a page of HTML", "save what is said as plain text"),
)
_XML = re.compile(r"\s*+(?:<\?xml\s|<!DOCTYPE\s|<\w++(?:\s[^<>]*)?>\s*+<)")
_TIME_CODE = re.compile(r"\s*+[\[(<{]?\d{1,4}:\d{2}(?::\d{2})?(?:[.,:;]\d{1,6})?[\])>}]?(?=[\s,;–—-]|$)")
_SHARE = 1 / 3  # of the lines that begin with a time code, from which on a text is no plain text [ours]


def decode(data: bytes, name: str) -> str:
    """The text of a file in UTF-8 or UTF-16, with or without a byte order mark.

    Raises:
        InputError: it is no text, or in another encoding.
    """
    if data.startswith(_NO_TEXT) or data[4:8] == b"ftyp":
        raise _describe_no_text(name)
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        encoding = "utf-16"
    elif b"\0" in data[:200:2] + data[1:200:2] and len(data) % 2 == 0:
        encoding = "utf-16-le" if data[1:200:2].count(0) > data[:200:2].count(0) else "utf-16-be"
    else:
        encoding = "utf-8-sig"
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        if encoding != "utf-16" and b"\0" in data:  # no mark of its encoding, and no text in UTF-8
            raise _describe_no_text(name) from None
        byte = f"byte 0x{data[error.start]:02x} at {error.start}"
        command = f"iconv -f CP1252 -t UTF-8 {_quote(name)} > utf8{Path(name).suffix[:12]}"
        hint = f"save it as UTF-8; Windows' Western text: {command}; CP1252 is SHIFT-JIS in Japan, GB18030 in China"
        raise InputError(f"{name!r} is not {encoding.removesuffix('-sig').upper()} text: {byte}", hint) from None
    if "\0" in text:
        raise InputError(f"{name!r} holds NUL characters", "is it a transcript? Save it as UTF-8 text")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _describe_no_text(name: str) -> InputError:
    hint = "TextGrid, .eaf, .tsv, .srt, .vtt, .ttml, .lrc, .json, or plain text in UTF-8"
    return InputError(f"{name!r} is no transcript: it is not text", hint)


def _quote(name: str) -> str:
    """A name for a shell, in a message of one line."""
    return shlex.quote(name) if len(name) <= 80 and name.isprintable() else "FILE"


def refuse_others(text: str, name: str) -> None:
    """Refuse text in formats that cannot be read.

    Raises:
        InputError: it is in such a format; the hint says how to convert it.
    """
    for pattern, what, hint in _OTHERS:
        if pattern.search(text[:_HEAD]) if pattern.flags & re.MULTILINE else pattern.match(text[:_HEAD]):
            advice = hint.format(name=_quote(name), stem=_quote(Path(name).stem))
            raise InputError(f"{name!r} holds {what}", advice)


def check_prose(text: str, name: str) -> None:
    """Check that a text without times is no markup, and has no time codes that would be read aloud.

    Raises:
        InputError: it is XML, or a third of its lines begin with a time code.
    """
    if _XML.match(text[:_HEAD]):
        raise InputError(f"{name!r} holds XML", "of XML, TTML and ELAN are read; save what is said as plain text")
    lines = [line for line in StringIO(text) if not line.isspace()]
    codes = [line.strip()[:60] for line in lines if _TIME_CODE.match(line)]
    if len(codes) > 1 and len(codes) >= _SHARE * len(lines):
        problem = f"{name!r} is read as plain text, but its lines have time codes: {codes[0]!r}"
        raise InputError(problem, "save it as .srt or .tsv, or take the times away")
