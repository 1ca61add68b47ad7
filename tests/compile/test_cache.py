"""The cache of nets: the same bytes, whole entries, whatever else happens."""

import threading

import pytest

from foresee_dsl.compile.nets import cache
from foresee_dsl.compile.nets.cache import cached_net, content_key
from foresee_dsl.compile.nets.network_builder import build_network
from foresee_dsl.errors import CompileError
from tests.support.worlds import four_arms


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("FORESEE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "nets"


class Builder:
    """Writes a text and counts how often it was asked."""

    def __init__(self, text=b"<net/>"):
        self.text, self.calls = text, 0

    def __call__(self, out):
        self.calls += 1
        out.write_bytes(self.text)


def test_a_net_is_built_once(own_cache):
    build = Builder()
    first, second = cached_net(["a"], build), cached_net(["a"], build)
    assert first == second
    assert first.read_bytes() == b"<net/>"
    assert build.calls == 1
    assert first.parent == own_cache / content_key(["a"])


def test_the_key_depends_on_every_part_and_on_the_tools(monkeypatch):
    keys = {content_key(parts) for parts in (["ab", "c"], ["a", "bc"], [b"abc"], ["abc", ""], [])}
    before = content_key(["abc"])
    assert len(keys) == 5
    assert content_key([b"abc"]) == before
    monkeypatch.setattr(cache, "FORMAT", cache.FORMAT + 1)
    assert content_key(["abc"]) != before
    monkeypatch.undo()
    monkeypatch.setattr(cache, "template_sources", lambda: (b"another template",))
    assert content_key(["abc"]) != before


@pytest.mark.parametrize("damage", ["cut", "changed", "no sum", "no net", "a file", "not ascii"])
def test_a_damaged_entry_is_rebuilt(damage):
    build = Builder()
    net = cached_net(["a"], build)
    if damage == "cut":
        net.write_bytes(b"<ne")
    elif damage == "changed":
        net.write_bytes(b"<net>")
    elif damage == "no sum":
        (net.parent / "sha256").unlink()
    elif damage == "no net":
        net.unlink()
    elif damage == "not ascii":
        (net.parent / "sha256").write_bytes(b"\xff\xfe")
    else:
        for file in net.parent.iterdir():
            file.unlink()
        net.parent.rmdir()
        net.parent.write_text("in the way")
    assert cached_net(["a"], build).read_bytes() == b"<net/>"
    assert build.calls == 2


def test_a_build_that_fails_leaves_nothing_behind(own_cache):
    def fail(out):
        out.write_bytes(b"half")
        raise CompileError("no")

    with pytest.raises(CompileError, match="no"):
        cached_net(["a"], fail)
    assert list(own_cache.iterdir()) == []
    assert cached_net(["a"], Builder()).read_bytes() == b"<net/>"


def test_two_builds_at_once_both_get_the_net(own_cache):
    both = threading.Barrier(2, timeout=10)

    def build(out):
        both.wait()  # neither has finished when the other begins
        out.write_bytes(b"<net/>")

    nets = []
    threads = [threading.Thread(target=lambda: nets.append(cached_net(["a"], build))) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(nets) == 2
    assert nets[0] == nets[1]
    assert nets[0].read_bytes() == b"<net/>"
    assert [p.name for p in own_cache.iterdir()] == [content_key(["a"])]


def test_a_cache_that_cannot_be_written_is_said_and_replaced(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("FORESEE_CACHE", str(tmp_path / "file"))
    with pytest.warns(UserWarning, match="FORESEE_CACHE can name another folder"):
        net = cached_net(["a"], Builder())
    assert net.is_file() and not net.is_relative_to(tmp_path)


def test_the_same_network_gives_the_same_bytes_in_another_place(tmp_path, monkeypatch):
    nets = []
    for name in ("one", "two"):
        monkeypatch.setenv("FORESEE_CACHE", str(tmp_path / name))
        nets.append(cached_net(["four_arms"], lambda out: build_network(four_arms(), out)))
    first, second = nets
    assert first != second
    assert first.read_bytes() == second.read_bytes()
    assert b"<!--" not in first.read_bytes()
    assert str(tmp_path).encode() not in first.read_bytes()
