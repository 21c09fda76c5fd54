"""What readers share: the text of small files, as Windows and others save it."""

from __future__ import annotations

import pytest

from cospeech.corpora.reading import read_rows, read_text
from cospeech.errors import InputError


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_text_is_read_in_the_encodings_of_windows(tmp_path, encoding):
    path = tmp_path / "a.csv"
    path.write_bytes("id,Wörter\r\n1,naïve\r\n".encode(encoding))
    assert read_rows(path) == [["id", "Wörter"], ["1", "naïve"]]


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ("Wörter".encode("cp1252"), "'a.txt' is not UTF-8 text: byte 0xf6 at 1 .save it as UTF-8"),
        (b"\xff\xfea\0b", "'a.txt' is not UTF-16 text: byte 0x62 at 4 .save it as UTF-8"),
        ("ab".encode("utf-16-le"), "holds NUL characters at 1 .*ave it as UTF-8"),
    ],
)
def test_what_is_no_such_text_is_told_with_what_helps(tmp_path, data, message):
    (tmp_path / "a.txt").write_bytes(data)
    with pytest.raises(InputError, match=message):
        read_text(tmp_path / "a.txt")
