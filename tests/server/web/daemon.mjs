// A daemon of one's own, in a folder of its own, on a free port.
import { spawn } from "node:child_process";
import { readFileSync } from "node:fs";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";

const patience = 20_000;

// {address, token, stop(), signal(name)}; the daemon prints the page's address, and the token to a terminal alone.
export async function startDaemon(program) {
  const folder = await mkdtemp(join(tmpdir(), "ferrobench-page-"));
  const child = spawn(program, ["--data", folder, "serve", "--port", "0", "--token-file", join(folder, "token")], { stdio: ["ignore", "pipe", "pipe"] });
  const said = [];
  const ended = new Promise((resolve) => child.once("close", resolve));
  const stop = async () => {
    child.kill("SIGTERM");
    await ended;
    await rm(folder, { recursive: true, force: true });
  };
  const found = new Promise((resolve, reject) => {
    const read = (line) => {
      said.push(line);
      const match = line.match(/(http:\/\/\S+?)\/?\?token=/);
      if (match) resolve({ address: match[1], token: readFileSync(join(folder, "token"), "utf8").trim(), stop, signal: (name) => child.kill(name) });
    };
    createInterface(child.stdout).on("line", read);
    createInterface(child.stderr).on("line", read);
    child.once("error", reject);
    ended.then(() => reject(new Error("the daemon ended")));
    setTimeout(() => reject(new Error("the daemon told no address")), patience).unref();
  });
  return found.catch(async (error) => {
    await stop();
    throw new Error(`${error.message}; it said:\n${said.join("\n")}`);
  });
}
