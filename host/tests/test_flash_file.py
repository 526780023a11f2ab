# SPDX-License-Identifier: Apache-2.0
"""`asi run --flash FILE`: the file that is the flash's content between two runs."""
import fcntl
from pathlib import Path

import pytest
from fake_bench import FakeBench
from typer.testing import CliRunner

from asi import cli, native
from asi.bench import NEW_FLASH, BenchError, FlashError, FlashFile, NativeBench

ROOT = Path(__file__).resolve().parents[2]
PACKAGING = ROOT / "sim/plants/packaging.toml"


class Bench(FakeBench):
    """Remembers the flash; writes one byte into it when it runs."""
    content = None

    def attach_flash(self, content):
        self.content = content

    def flash_content(self):
        return b"\x12" + self.content[1:]


@pytest.fixture
def run(tmp_path, monkeypatch):
    """run(file, ...) -> (exit code, standard error, the bench or None)"""
    def call(file, *arguments, bench=None):
        made = []

        def open_bench(*_):
            made.append(bench or Bench())
            return made[0]
        monkeypatch.setattr(cli, "open_bench", open_bench)
        result = CliRunner().invoke(cli.app, ["run", str(PACKAGING), "--quick", "--out", str(tmp_path / "run"),
                                              *(["--flash", str(file)] if file else []), *arguments])
        assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
        return result.exit_code, result.stderr, made[0] if made else None
    return call


def test_created_and_kept(run, tmp_path):
    """NV-001, PL-002: a missing file is made, erased; after the run it has what the flash has; the next run begins
    with that. Without the option there is no flash."""
    file = tmp_path / "plant.flash"
    code, err, bench = run(file)
    assert (code, err, bench.content) == (0, "", b"\xFF" * NEW_FLASH)
    assert file.read_bytes() == b"\x12" + b"\xFF" * (NEW_FLASH - 1)
    assert run(file)[2].content == file.read_bytes()
    assert run(None)[2].content is None


def test_kept_after_every_end(run, tmp_path):
    """NV-001, PL-002: Ctrl-C and a failed simulation give the content back as well."""
    file = tmp_path / "plant.flash"
    assert run(file, bench=Bench(break_at_ns=100_000_000))[0] == 130
    assert file.read_bytes()[0] == 0x12
    file.unlink()
    assert run(file, bench=Bench(boots=False))[0] == 3
    assert file.read_bytes()[0] == 0x12


def test_refused_files(run, tmp_path):
    """NV-005, PL-002: a folder, a file of another size, one in a folder that is not there, one in use: one line with
    the name, code 2, nothing runs, nothing is changed."""
    wrong = tmp_path / "wrong.flash"
    wrong.write_bytes(b"x" * 1000)
    empty = tmp_path / "empty.flash"
    empty.write_bytes(b"")
    large = tmp_path / "large.flash"
    with open(large, "wb") as out:
        out.truncate((1 << 24) + 1)
    used = tmp_path / "used.flash"
    for file, reason in ((tmp_path, "Is a directory"), (tmp_path / "no" / "x", "No such file or directory"),
                         (wrong, "2, 4, 8, 16 MB long, exactly"), (empty, "MB long, exactly"),
                         (large, "MB long, exactly"), (used, "another run has this flash")):
        holder = FlashFile(file) if file == used else None
        code, err, bench = run(file)
        assert (code, bench) == (2, None) and len(err.splitlines()) == 1
        assert err.startswith(f"{file}: ") and reason in err
        if holder:
            holder.close()
    assert wrong.read_bytes() == b"x" * 1000 and empty.read_bytes() == b"" and not (tmp_path / "no").exists()
    assert run(used)[0] == 0  # free again


def test_unwritable_after_the_run(run, tmp_path, monkeypatch):
    """NV-001, PL-002: content that cannot be written back is a failure with the file's name, not silence."""
    def full(*_):
        raise OSError(28, "No space left on device")
    file = tmp_path / "plant.flash"
    FlashFile(file).close()
    monkeypatch.setattr(FlashFile, "_put", full)
    code, err, _ = run(file)
    assert (code, err) == (3, f"{file}: No space left on device\n")


def test_flash_of_the_native_bench(monkeypatch):
    """NV-008: the content reaches the flash model on the chip; an operation that is under way at the end is broken off,
    as by a power failure; a missing library is a BenchError."""
    class Chip:
        net, clk_hz, flash = None, 16_000_000, None

        def attach_flash(self, flash):
            self.flash = flash
            flash.power_up()
    bench = NativeBench(Chip())
    content = bytes(range(256)) * (NEW_FLASH // 256)
    bench.attach_flash(content)
    assert bench.flash_content() == content
    flash, at = bench.chip.flash, 0
    for frame in (b"\xAB", b"\x06", b"\x20\x11\x00\x00"):  # wake, write enable, erase: 45 ms, and it ends before them
        at += 1_000_000
        flash.select(at, True)
        for byte in frame:
            flash.byte(at, byte)
        flash.select(at, False)
    left = bench.flash_content()
    assert left[:0x110000] == content[:0x110000] and left[0x111000:] == content[0x111000:]
    assert flash.counts()[2:] == (1, 0)  # begun
    assert left != content or any(flash.doubt(0x110000, 4096))
    assert left[0x110000:0x111000] != b"\xFF" * 4096 or any(flash.doubt(0x110000, 4096))  # not ended

    def refuse(size):
        raise native.NativeError("libasi_slaves.so is missing")
    monkeypatch.setattr(native, "Flash", refuse)
    with pytest.raises(BenchError, match="libasi_slaves.so is missing"):
        bench.attach_flash(content)


def test_held_until_closed(tmp_path):
    """NV-001: one holder at a time, of an existing file too; unchanged content is not written."""
    file = tmp_path / "plant.flash"
    first = FlashFile(file)
    with pytest.raises(FlashError, match="another run"):
        FlashFile(file)
    assert len(file.read_bytes()) == NEW_FLASH  # the refused one has not touched it
    first.write(first.content)
    first.write(b"\0" * NEW_FLASH)
    first.close()
    second = FlashFile(file)
    assert second.content == bytes(NEW_FLASH)
    second.close()
    with open(file, "rb") as anybody:
        fcntl.flock(anybody, fcntl.LOCK_EX | fcntl.LOCK_NB)
