// Starts `foresee lsp`, connects the editor with it, and does what its code lenses call: a terminal, or the picture.
"use strict";

const vscode = require("vscode");
const { LanguageClient } = require("vscode-languageclient/node");
const logic = require("./logic");
const { Picture } = require("./picture");

/** @type {LanguageClient | undefined} */
let client;
const picture = new Picture(() => client);

function program() {
  return vscode.workspace.getConfiguration("foresee").get("command", "foresee");
}

async function start() {
  const command = program();
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
      + "Install it with `pip install foresee-dsl`, or set `foresee.command` to where it is.";
    vscode.window.showErrorMessage(message);
  }
}

async function stop() {
  const running = client;
  client = undefined;
  await running?.stop();
}

async function restart() {
  await stop();
  await start();
}

/** Run a command of foresee in the terminal, for an address of a code lens or the file that is looked at. */
async function inTerminal(verb, address) {
  const document = vscode.window.activeTextEditor?.document;
  if (!address && !logic.drawable(document)) return;
  await document?.save();
  const name = `foresee ${verb}`;
  const terminal = vscode.window.terminals.find((one) => one.name === name && one.exitStatus === undefined)
    ?? vscode.window.createTerminal({ name });
  terminal.show(true);
  terminal.sendText(logic.commandLine(program(), verb, address || document.uri.fsPath, process.platform === "win32"));
}

async function draw(address) {
  if (typeof address === "string") {
    const { file, case: name } = logic.parsed(address);
    await picture.open(await vscode.workspace.openTextDocument(vscode.Uri.file(file)), name);
  } else if (logic.drawable(vscode.window.activeTextEditor?.document)) {
    await picture.open(vscode.window.activeTextEditor.document);
  }
}

async function activate(context) {
  context.subscriptions.push(
    vscode.commands.registerCommand("foresee.restart", restart),
    vscode.commands.registerCommand("foresee.run", (address) => inTerminal("run", address)),
    vscode.commands.registerCommand("foresee.forecast", (address) => inTerminal("forecast", address)),
    vscode.commands.registerCommand("foresee.draw", draw),
    vscode.workspace.onDidChangeTextDocument((event) => picture.changed(event.document)),
    vscode.window.onDidChangeActiveTextEditor((editor) => picture.looked(editor?.document)),
  );
  await start();
}

module.exports = { activate, deactivate: stop };
