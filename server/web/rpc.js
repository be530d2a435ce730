// JSON-RPC over one WebSocket that is opened again when it breaks. While it is down calls go by HTTP, so that
// Stop reaches the daemon as long as anything does.

export class RpcError extends Error {
  constructor({ code, message, data }) {
    super(String(message));
    this.code = code;
    this.label = data?.name ?? "";
    this.problems = Array.isArray(data?.problems) ? data.problems : [];
  }
}

const unreachable = (why) =>
  new RpcError({ code: 0, message: "The daemon does not answer", data: { name: "", problems: [{ message: why }] } });

export class Rpc {
  #socket = null;
  #id = 0;
  #waiting = new Map();
  #topics = new Map();
  #delay = 500;
  heard = performance.now(); // when anything last came from the daemon, ms

  // onState(open, seconds until the next try)
  constructor(onState) {
    this.onState = onState;
  }

  connect() {
    const url = new URL("/rpc", location.href);
    url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
    const socket = new WebSocket(url);
    socket.onopen = () => {
      this.#socket = socket;
      this.#delay = 500;
      this.heard = performance.now();
      this.onState(true, 0);
    };
    socket.onmessage = (event) => this.#take(JSON.parse(event.data));
    socket.onclose = () => {
      this.#socket = null;
      for (const { reject } of this.#waiting.values()) reject(unreachable("the connection broke"));
      this.#waiting.clear();
      this.onState(false, this.#delay / 1000);
      setTimeout(() => this.connect(), this.#delay);
      this.#delay = Math.min(this.#delay * 2, 4000);
    };
  }

  get open() {
    return this.#socket !== null;
  }

  // fn(params) for every notification of the topic.
  on(topic, fn) {
    this.#topics.set(topic, fn);
  }

  call(method, params = {}) {
    const id = ++this.#id;
    const text = JSON.stringify({ jsonrpc: "2.0", id, method, params });
    if (!this.#socket) return this.#post(text);
    return new Promise((resolve, reject) => {
      this.#waiting.set(id, { resolve, reject });
      this.#socket.send(text);
    });
  }

  async #post(text) {
    let reply;
    try {
      const response = await fetch("/rpc", {
        method: "POST", body: text, headers: { "Content-Type": "application/json" },
      });
      reply = await response.json();
    } catch (error) {
      throw unreachable(error.message);
    }
    this.heard = performance.now();
    if (reply.error) throw new RpcError(reply.error);
    if (!("result" in reply))
      throw new RpcError({ code: 0, message: reply.message, data: { problems: [{ hint: reply.hint }] } });
    return reply.result;
  }

  #take(message) {
    this.heard = performance.now();
    if (message.method) return this.#topics.get(message.method)?.(message.params);
    const waiting = this.#waiting.get(message.id);
    this.#waiting.delete(message.id);
    if (message.error) waiting?.reject(new RpcError(message.error));
    else waiting?.resolve(message.result);
  }
}
