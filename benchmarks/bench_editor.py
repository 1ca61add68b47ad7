"""The language server over its protocol: first diagnostics, a rename, a picture; a new process each time."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.figures import Figure, costs, run_program
from foresee_dsl.files import data_folder

ROUNDS = 7
"""Number of rounds. Ours: processes of half a second; the median of seven varied by 5 % on a quiet machine."""
_FILE, _OLD = "scenario7.foresee", "king_oak"
_KEYSTROKES = 10
_PUBLISHED = "textDocument/publishDiagnostics"


class Client:
    """A minimal client of `foresee lsp`: it sends messages, and waits for answers."""

    def __init__(self, folder: Path) -> None:
        code = "from foresee_dsl.cli import main; main()"
        command = [sys.executable, "-c", code, "lsp"]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)  # noqa: S603 - ours
        self._number = 0
        self.ask("initialize", {"capabilities": {}, "workspaceFolders": [{"uri": folder.as_uri(), "name": "work"}]})
        self.tell("initialized", {})

    def tell(self, method: str, params: Any, **more: Any) -> None:  # noqa: ANN401 - JSON
        """Send a notification (or, with an `id`, a request)."""
        body = json.dumps({"jsonrpc": "2.0", "method": method, "params": params, **more}).encode()
        assert self.process.stdin is not None  # noqa: S101 - a pipe, as asked for
        self.process.stdin.write(b"Content-Length: %d\r\n\r\n%s" % (len(body), body))
        self.process.stdin.flush()

    def ask(self, method: str, params: Any) -> Any:  # noqa: ANN401 - JSON
        """Send a request and return its answer."""
        self._number += 1
        self.tell(method, params, id=self._number)
        return self.until(lambda message: message.get("id") == self._number and "method" not in message)

    def until(self, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Read messages up to the first for which `wanted` returns True, and return that one."""
        assert self.process.stdout is not None  # noqa: S101 - a pipe, as asked for
        while True:
            length = 0
            while (line := self.process.stdout.readline().strip()) != b"":
                if line.lower().startswith(b"content-length:"):
                    length = int(line.partition(b":")[2])
            message: dict[str, Any] = json.loads(self.process.stdout.read(length))
            if wanted(message):
                return message

    def open(self, file: Path, text: str) -> str:
        """Open a document."""
        uri = file.as_uri()
        document = {"uri": uri, "languageId": "foresee", "version": 1, "text": text}
        self.tell("textDocument/didOpen", {"textDocument": document})
        return uri

    def close(self) -> None:
        """End the session."""
        self.ask("shutdown", None)
        self.tell("exit", None)
        self.process.wait()


def figures() -> Iterator[Figure]:
    """Measure, and return the figures of the language server."""
    with tempfile.TemporaryDirectory(prefix="foresee-bench-") as name:
        folder = Path(name)
        shutil.copytree(data_folder("scenarios"), folder, dirs_exist_ok=True)
        text = (folder / _FILE).read_text(encoding="utf-8")

        def first_mistakes() -> float:
            """Return the time from starting the process to the first diagnostics of a text with an error, s."""
            began = time.perf_counter()
            client = Client(folder)
            client.open(folder / _FILE, text.replace("ego: car", "ego: cra", 1))
            client.until(
                lambda m: m.get("method") == "textDocument/publishDiagnostics" and bool(m["params"]["diagnostics"])
            )
            elapsed_s = time.perf_counter() - began
            client.process.kill()
            client.process.wait()
            return elapsed_s

        def rename() -> float:
            """Return the time to rename a junction of the town, in 23 files, after the first diagnostics, s."""
            client = Client(folder)
            uri = client.open(folder / _FILE, text)
            client.until(lambda m: m.get("method") == _PUBLISHED)
            offset = text.index(_OLD)
            line, column = text.count("\n", 0, offset), offset - text.rfind("\n", 0, offset) - 1
            began = time.perf_counter()
            params = {"textDocument": {"uri": uri}, "position": {"line": line, "character": column}, "newName": "cross"}
            edit = client.ask("textDocument/rename", params)
            elapsed_s = time.perf_counter() - began
            if len(edit["result"]["changes"]) < 2:
                raise RuntimeError("nothing was renamed")
            client.close()
            return elapsed_s

        def picture() -> float:
            """The slower half of some keystrokes' pictures, after the first."""
            client = Client(folder)
            uri = client.open(folder / _FILE, text)
            elapsed = []
            for k in range(_KEYSTROKES):
                began = time.perf_counter()
                typed = text.replace("6 s", f"6.{k} s", 1)
                client.ask("foresee/draw", {"textDocument": {"uri": uri}, "text": typed, "width": 600})
                elapsed.append(time.perf_counter() - began)
            client.close()
            return median(sorted(elapsed[2:])[len(elapsed[2:]) // 2 :])

        first_mistakes()  # puts the parser into the cache
        picture()  # puts the network into the cache
        cost = costs(
            {
                "pydantic": lambda: run_program([sys.executable, "-c", "import pydantic"])[0],
                "mistakes": first_mistakes,
                "rename": rename,
                "picture": picture,
            },
            ROUNDS,
        )
    middle = {name: median(kinds[0]) for name, kinds in cost.items()}
    yield Figure(
        "lsp_first_mistakes_s", middle["mistakes"], "s", "from starting the process to the first diagnostics", 1.0
    )
    yield Figure("lsp_rename_s", middle["rename"], "s", "rename of a junction in 23 files, right after them", 1.0)
    yield Figure("lsp_picture_s", middle["picture"], "s", "a picture after a keystroke, warm", 0.15)
    for name, means in (
        ("mistakes", "first diagnostics over `import pydantic`"),
        ("rename", "that rename over `import pydantic`"),
        ("picture", "that picture over `import pydantic`"),
    ):
        yield Figure(f"lsp_{name}_over_pydantic", middle[name] / middle["pydantic"], "ratio", means)
