// The picture beside the text: a web view that draws again on every keystroke that parses.
"use strict";

const { randomBytes } = require("crypto");
const vscode = require("vscode");
const logic = require("./logic");

class Picture {
  /** @param {() => import("vscode-languageclient/node").LanguageClient | undefined} client */
  constructor(client) {
    this.client = client;
    this.panel = undefined;
    this.document = undefined;
    this.wish = { case: "", whole: false, width: 720 };
    this.latest = new logic.Latest(() => this.answer(), (state) => this.panel?.webview.postMessage({ type: "picture", state }));
  }

  /** Show a document's picture: of a case, where one is named. */
  async open(document, name = "") {
    this.document = document;
    this.wish = { ...this.wish, case: name };
    this.latest.about(`${document.uri} ${name}`);
    if (!this.panel) await this.create();
    else this.panel.reveal(undefined, true);
    this.panel.webview.postMessage({ type: "case", case: name });
    await this.latest.changed();
  }

  async create() {
    const column = vscode.ViewColumn.Beside;
    const panel = vscode.window.createWebviewPanel("foresee.picture", "foresee: picture", { viewColumn: column, preserveFocus: true }, {
      enableScripts: true,
      localResourceRoots: [],
      retainContextWhenHidden: true,
    });
    this.panel = panel;
    this.greeted = false;
    panel.onDidDispose(() => { this.panel = undefined; });
    panel.webview.onDidReceiveMessage((message) => this.received(message));
    const page = await this.client()?.sendRequest("foresee/page", { nonce: logic.nonce(randomBytes(16)) });
    if (page) panel.webview.html = page.html;
  }

  async received(message) {
    if (message.type === "goto") {
      const document = await vscode.workspace.openTextDocument(vscode.Uri.file(message.path));
      const line = Math.min(Math.max(message.line - 1, 0), document.lineCount - 1);
      const place = logic.target(message, document.lineAt(line).text);
      if (!place) return;
      const at = new vscode.Position(line, place.character);
      await vscode.window.showTextDocument(document, { viewColumn: vscode.ViewColumn.One, selection: new vscode.Range(at, at) });
      return;
    }
    // a page that has just been loaded does not know yet which case it is to show
    this.wish = logic.wished(this.wish, this.greeted ? message : { ...message, case: this.wish.case });
    this.greeted = true;
    await this.latest.changed();
  }

  /** The text has changed, or another one is looked at. */
  changed(document) {
    if (!this.panel || !logic.drawable(document)) return;
    if (String(document.uri) !== String(this.document?.uri)) return;
    this.latest.changed();
  }

  looked(document) {
    if (!this.panel || !logic.drawable(document) || String(document.uri) === String(this.document?.uri)) return;
    this.open(document);
  }

  async answer() {
    const client = this.client();
    if (!client || !this.document) return null;
    return client.sendRequest("foresee/draw", logic.question(String(this.document.uri), this.document.getText(), this.wish));
  }
}

module.exports = { Picture };
