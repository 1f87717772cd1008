/** The websocket: messages out and in, and a new try, less and less often, when it breaks. */

import { decode, type Frame } from "./frames";
import { type FromClient, type FromServer, PROTOCOL } from "./protocol";

export type Link = "connecting" | "open" | "waiting" | "refused";

type Of<T extends FromServer["type"]> = Extract<FromServer, { type: T }>;
type Listener<T extends FromServer["type"]> = (message: Of<T>) => void;

const FIRST_WAIT = 300;
const LONGEST_WAIT = 8000;

/** What closing codes mean to a person. */
const CLOSED: Record<number, string> = {
  1012: "The server is restarting.",
  1013: "The server has as many visitors as it takes. Close another page of it, or wait.",
  1008: "The server closed the connection as too much was sent.",
  1009: "The server closed the connection as a message was too large.",
};

export class Connection {
  link: Link = "connecting";
  why = "";
  /** When the next try begins, on the clock of `performance.now`. */
  retryAt = 0;
  /** Milliseconds from here to the server and back, smoothed. */
  roundTrip: number | null = null;
  /** Bytes of frames that came in the last second. */
  bytesPerSecond = 0;
  framesPerSecond = 0;
  private socket: WebSocket | null = null;
  private wait = FIRST_WAIT;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private readonly listeners = new Map<string, Set<(message: never) => void>>();
  private readonly frameListeners = new Set<(frame: Frame, at: number) => void>();
  private readonly linkListeners = new Set<(link: Link) => void>();
  private requests = 0;
  private bytes = 0;
  private frames = 0;

  constructor(private readonly url: string) {
    setInterval(() => {
      this.bytesPerSecond = this.bytes;
      this.framesPerSecond = this.frames;
      this.bytes = this.frames = 0;
      this.send({ type: "ping", at: performance.now() });
    }, 1000);
    addEventListener("online", () => this.link === "waiting" && this.open());
  }

  open(): void {
    clearTimeout(this.timer);
    this.tell("connecting");
    const socket = new WebSocket(this.url, PROTOCOL);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.addEventListener("message", (event: MessageEvent<string | ArrayBuffer>) => this.receive(socket, event.data));
    socket.addEventListener("close", (event) => this.closed(socket, event.code));
  }

  /** Say something; it is lost when there is no connection (what must not be is said again after `welcome`). */
  send(message: FromClient): boolean {
    if (this.socket?.readyState !== WebSocket.OPEN || this.link !== "open") return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  /** A number for a request, to know its answer by. */
  nextRequest(): number {
    return ++this.requests;
  }

  on<T extends FromServer["type"]>(type: T, listener: Listener<T>): () => void {
    const set = this.listeners.get(type) ?? new Set();
    set.add(listener as (message: never) => void);
    this.listeners.set(type, set);
    return () => set.delete(listener as (message: never) => void);
  }

  onFrame(listener: (frame: Frame, at: number) => void): () => void {
    this.frameListeners.add(listener);
    return () => this.frameListeners.delete(listener);
  }

  onLink(listener: (link: Link) => void): () => void {
    this.linkListeners.add(listener);
    return () => this.linkListeners.delete(listener);
  }

  private receive(socket: WebSocket, data: string | ArrayBuffer): void {
    if (socket !== this.socket) return;
    const now = performance.now();
    if (typeof data !== "string") {
      this.bytes += data.byteLength;
      this.frames++;
      const frame = decode(data);
      for (const listener of this.frameListeners) listener(frame, now);
      return;
    }
    const message = JSON.parse(data) as FromServer;
    if (message.type === "welcome") {
      this.wait = FIRST_WAIT;
      this.tell("open");
    }
    if (message.type === "pong") {
      const trip = now - message.at;
      this.roundTrip = this.roundTrip === null ? trip : this.roundTrip + (trip - this.roundTrip) * 0.3;
    }
    for (const listener of this.listeners.get(message.type) ?? []) listener(message as never);
  }

  private closed(socket: WebSocket, code: number): void {
    if (socket !== this.socket) return;
    this.socket = null;
    this.roundTrip = null;
    this.why = CLOSED[code] ?? "";
    if (code === 4400) {
      this.why = "This page and the server are of different versions. Reload the page.";
      this.tell("refused");
      return;
    }
    this.retryAt = performance.now() + this.wait;
    this.timer = setTimeout(() => this.open(), this.wait);
    this.wait = Math.min(LONGEST_WAIT, this.wait * 1.7);
    this.tell("waiting");
  }

  private tell(link: Link): void {
    if (this.link === link) return;
    this.link = link;
    for (const listener of this.linkListeners) listener(link);
  }
}
