/** States that can be taken back and done again. */

const MOST = 200;

export class History<T> {
  private past: T[] = [];
  private future: T[] = [];
  private run: string | null = null;

  constructor(private now: T) {}

  get present(): T {
    return this.now;
  }

  get canUndo(): boolean {
    return this.past.length > 0;
  }

  get canRedo(): boolean {
    return this.future.length > 0;
  }

  /** A new state. Those of one `run`, such as a drag or typing in one field, are taken back together. */
  push(next: T, run: string | null = null): void {
    if (next === this.now) return;
    if (run === null || run !== this.run) {
      this.past.push(this.now);
      if (this.past.length > MOST) this.past.shift();
    }
    this.run = run;
    this.future = [];
    this.now = next;
  }

  /** The next state begins anew, even in a run of the same name. */
  seal(): void {
    this.run = null;
  }

  undo(): boolean {
    const before = this.past.pop();
    if (before === undefined) return false;
    this.future.push(this.now);
    this.now = before;
    this.run = null;
    return true;
  }

  redo(): boolean {
    const after = this.future.pop();
    if (after === undefined) return false;
    this.past.push(this.now);
    this.now = after;
    this.run = null;
    return true;
  }
}
