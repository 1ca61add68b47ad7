// What the extension decides, without the editor: tested by `node --test test`.
"use strict";

/** A word as a shell reads it: of `sh`, or of PowerShell and cmd on Windows. */
function quoted(word, windows) {
  if (/^[A-Za-z0-9_\-./:\\@%+=,]+$/.test(word) && !(windows ? /%/.test(word) : /\\/.test(word))) return word;
  return windows ? `"${word.replace(/"/g, '""')}"` : `'${word.replace(/'/g, "'\\''")}'`;
}

/** The line for a terminal: `foresee run 'FILE::CASE'`, or `foresee forecast ...`. */
function commandLine(command, verb, address, windows = false) {
  if (!["run", "forecast"].includes(verb)) throw new Error(`no command ${verb}`);
  const call = windows && quoted(command, true) !== command ? `& ${quoted(command, true)}` : quoted(command, windows);
  return `${call} ${verb} ${quoted(address, windows)}`;
}

/** File and case of an address; a drive's colon is no mark of a case. */
function parsed(address) {
  const at = address.lastIndexOf("::");
  return at < 0 ? { file: address, case: "" } : { file: address.slice(0, at), case: address.slice(at + 2) };
}

/** What `foresee/draw` is asked with: the document's present text and what the page wishes. */
function question(uri, text, wish) {
  return { textDocument: { uri }, text, case: wish.case || "", whole: Boolean(wish.whole), width: wish.width || 720 };
}

/** The page's message as a place for the editor (from 0, in UTF-16), or null for none. */
function target(message, lineText) {
  if (!message || message.type !== "goto" || !message.path || !(message.line >= 1)) return null;
  const text = lineText ?? "";
  const before = Array.from(text).slice(0, Math.max((message.column || 1) - 1, 0)).join("");
  return { path: message.path, line: message.line - 1, character: before.length };
}

/** The page's wishes after one of its messages. */
function wished(wish, message) {
  if (!message || message.type !== "wish") return wish;
  return { case: String(message.case || ""), whole: Boolean(message.whole), width: Number(message.width) || 720 };
}

/** Whether a document is one that has a picture. */
function drawable(document) {
  return Boolean(document) && document.languageId === "foresee" && document.uri.scheme === "file";
}

/**
 * Asks again whenever something has changed, one question at a time: what changed while an answer was under way is
 * asked once, with the newest text. Answers that are overtaken are shown all the same, so that typing on never stops
 * the picture; an answer about another document is dropped.
 */
class Latest {
  constructor(ask, show) {
    this.ask = ask;
    this.show = show;
    this.busy = false;
    this.again = false;
    this.topic = "";
  }

  about(topic) {
    this.topic = topic;
  }

  async changed() {
    if (this.busy) {
      this.again = true;
      return;
    }
    this.busy = true;
    try {
      do {
        this.again = false;
        const topic = this.topic;
        let answer = null;
        try {
          answer = await this.ask();
        } catch (error) {
          answer = { svg: null, mistakes: [{ message: String(error.message || error), path: "", line: 0, column: 0 }] };
        }
        if (answer && topic === this.topic) this.show(answer);
      } while (this.again);
    } finally {
      this.busy = false;
    }
  }
}

/** A nonce for the page's scripts and styles. */
function nonce(random) {
  return Array.from(random, (byte) => byte.toString(16).padStart(2, "0")).join("");
}

module.exports = { Latest, commandLine, drawable, nonce, parsed, question, quoted, target, wished };
