// The one time of the page: it plays, jumps and steps; everything that depends on time listens.

export const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];

export class Clock {
  time = 0;
  start = 0;
  end = 0;
  playing = false;
  speed = 1;
  /** The end moves; who plays up to it stays there. */
  live = false;
  /** Stay at the end as it moves. */
  following = false;
  private readonly listeners: (() => void)[] = [];
  private last = 0;

  onChange(listener: () => void): void {
    this.listeners.push(listener);
  }

  seek(time: number): void {
    this.time = Math.min(Math.max(time, this.start), this.end);
    this.following = this.live && time >= this.end;
    this.tell();
  }

  play(on = !this.playing): void {
    if (on && this.time >= this.end) this.time = this.start;
    this.playing = on;
    this.last = 0;
    this.tell();
    if (on) requestAnimationFrame((now) => this.tick(now));
  }

  setSpeed(speed: number): void {
    this.speed = speed;
    this.tell();
  }

  faster(by: number): void {
    const place = SPEEDS.indexOf(this.speed) + by;
    if (place >= 0 && place < SPEEDS.length) this.setSpeed(SPEEDS[place]!);
  }

  /** The range grows (live) or is set (replay). */
  span(start: number, end: number): void {
    this.start = start;
    this.end = end;
    this.time = this.following ? end : Math.min(Math.max(this.time, start), end);
    this.tell();
  }

  private tick(now: number): void {
    if (!this.playing) return;
    if (this.last) this.time += ((now - this.last) / 1000) * this.speed;
    this.last = now;
    if (this.time >= this.end) {
      this.time = this.end;
      this.playing = false;
      this.following = this.live;
    } else requestAnimationFrame((next) => this.tick(next));
    this.tell();
  }

  private tell(): void {
    for (const listener of this.listeners) listener();
  }
}
