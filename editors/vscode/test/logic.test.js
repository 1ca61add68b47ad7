"use strict";

const assert = require("node:assert/strict");
const { test } = require("node:test");
const logic = require("../logic");

test("command lines are safe in every shell", () => {
  assert.equal(logic.commandLine("foresee", "run", "/a/b.foresee::r01"), "foresee run /a/b.foresee::r01");
  assert.equal(logic.commandLine("/my env/foresee", "run", "/a b/it's $(x).foresee"), "'/my env/foresee' run '/a b/it'\\''s $(x).foresee'");
  assert.equal(logic.commandLine("foresee", "forecast", "C:\\a b\\c.foresee::x", true), 'foresee forecast "C:\\a b\\c.foresee::x"');
  assert.equal(logic.commandLine("C:\\my env\\foresee.exe", "run", "C:\\a.foresee", true), '& "C:\\my env\\foresee.exe" run C:\\a.foresee');
  assert.throws(() => logic.commandLine("foresee", "rm", "x"));
});

test("an address has a file and perhaps a case", () => {
  assert.deepEqual(logic.parsed("/a/b.foresee::r01"), { file: "/a/b.foresee", case: "r01" });
  assert.deepEqual(logic.parsed("C:\\a.foresee"), { file: "C:\\a.foresee", case: "" });
});

test("a click is a place in UTF-16", () => {
  const message = { type: "goto", path: "/a", line: 3, column: 4 };
  assert.deepEqual(logic.target(message, "🚗🚗 ego"), { path: "/a", line: 2, character: 5 });
  assert.equal(logic.target({ ...message, line: 0 }, ""), null);
  assert.equal(logic.target({ ...message, type: "wish" }, ""), null);
});

test("a question has the present text and the page's wishes", () => {
  const wish = logic.wished({ case: "", whole: false, width: 720 }, { type: "wish", case: "r02", whole: true, width: 431 });
  assert.deepEqual(logic.question("file:///a", "text", wish), {
    textDocument: { uri: "file:///a" }, text: "text", case: "r02", whole: true, width: 431,
  });
  assert.deepEqual(logic.wished(wish, { type: "goto" }), wish);
});

test("only files of the language have a picture", () => {
  assert.equal(logic.drawable({ languageId: "foresee", uri: { scheme: "file" } }), true);
  assert.equal(logic.drawable({ languageId: "foresee", uri: { scheme: "untitled" } }), false);
  assert.equal(logic.drawable({ languageId: "json", uri: { scheme: "file" } }), false);
  assert.equal(logic.drawable(undefined), false);
});

test("ten keystrokes while an answer is under way are one more question, about the newest text", async () => {
  const asked = [];
  const shown = [];
  let text = "a";
  let release;
  const latest = new logic.Latest(
    () => { asked.push(text); return new Promise((resolve) => { const now = text; release = () => resolve(now); }); },
    (answer) => shown.push(answer),
  );
  const first = latest.changed();
  for (let k = 0; k < 10; k += 1) { text += k; latest.changed(); }
  release();
  await new Promise((resolve) => setImmediate(resolve));
  release();
  await first;
  assert.deepEqual(asked, ["a", "a0123456789"]);
  assert.deepEqual(shown, ["a", "a0123456789"]);
});

test("an answer about another document is dropped, a fault is shown", async () => {
  const shown = [];
  let answer = async () => { latest.about("b"); return "of a"; };
  const latest = new logic.Latest(() => answer(), (state) => shown.push(state));
  latest.about("a");
  await latest.changed();
  assert.deepEqual(shown, []);
  answer = async () => { throw new Error("gone"); };
  await latest.changed();
  assert.equal(shown[0].svg, null);
  assert.equal(shown[0].mistakes[0].message, "gone");
});

test("a nonce is letters and digits", () => {
  assert.equal(logic.nonce([0, 255, 16]), "00ff10");
});
