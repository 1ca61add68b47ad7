// Starts `foresee lsp` and connects the editor with it; everything else is the server's.
"use strict";

const vscode = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");

/** @type {LanguageClient | undefined} */
let client;

async function start() {
  const command = vscode.workspace.getConfiguration("foresee").get("command", "foresee");
  const run = { command, args: ["lsp"] };
  client = new LanguageClient(
    "foresee",
    "foresee",
    { run, debug: run },
    { documentSelector: [{ language: "foresee" }] },
  );
  try {
    await client.start();
  } catch (error) {
    client = undefined;
    const message = `foresee: \`${command} lsp\` does not start (${error}). `
      + "Install it with `pip install 'foresee-dsl[lsp]'`, or set `foresee.command` to where it is.";
    vscode.window.showErrorMessage(message);
  }
}

async function stop() {
  const running = client;
  client = undefined;
  await running?.stop();
}

async function activate(context) {
  context.subscriptions.push(
    vscode.commands.registerCommand("foresee.restart", async () => {
      await stop();
      await start();
    }),
  );
  await start();
}

module.exports = { activate, deactivate: stop };
