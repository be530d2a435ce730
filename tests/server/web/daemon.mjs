// A daemon of one's own, in a folder of its own, on a free port.
import { spawn } from "node:child_process";
import { readFileSync } from "node:fs";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";

const patience = 60_000; // ms; it bounds a hang

export class Daemon {
  #program;
  #folder;
  #child = null;
  #ended = null;

  constructor(program) {
    this.#program = program;
  }

  // The daemon prints the page's address, and the token to a terminal alone. Started again, it has the port and the
  // recordings that it had before.
  async start() {
    this.#folder ??= await mkdtemp(join(tmpdir(), "ferrobench-page-"));
    const token = join(this.#folder, "token");
    const port = this.address ? new URL(this.address).port : "0";
    const child = spawn(this.#program, ["--data", this.#folder, "serve", "--port", port, "--token-file", token], { stdio: ["ignore", "pipe", "pipe"] });
    this.#child = child;
    this.#ended = new Promise((resolve) => child.once("exit", resolve));
    const said = [];
    try {
      this.address = await new Promise((resolve, reject) => {
        const read = (line) => {
          said.push(line);
          const match = line.match(/(http:\/\/\S+?)\/?\?token=/);
          if (match) resolve(match[1]);
        };
        createInterface(child.stdout).on("line", read);
        createInterface(child.stderr).on("line", read);
        child.once("error", reject);
        this.#ended.then(() => reject(new Error("the daemon ended")));
        setTimeout(() => reject(new Error("the daemon told no address")), patience).unref();
      });
    } catch (error) {
      await this.stop();
      throw new Error(`${error.message}; it said:\n${said.join("\n")}`);
    }
    this.token = readFileSync(token, "utf8").trim();
  }

  signal(name) {
    this.#child.kill(name);
  }

  // Of the processor, so far, s; of the server alone: what holds the voltage is a process of its own.
  processorTime() {
    const stat = readFileSync(`/proc/${this.#child.pid}/stat`, "utf8");
    const [user, system] = stat.slice(stat.lastIndexOf(")") + 2).split(" ").slice(11, 13).map(Number);
    return (user + system) / 100; // the kernel counts in hundredths, whatever its own clock
  }

  async kill() {
    this.signal("SIGKILL");
    await this.#ended;
  }

  async stop() {
    this.signal("SIGTERM");
    await this.#ended;
    await rm(this.#folder, { recursive: true, force: true });
  }
}
