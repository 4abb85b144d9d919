/* Frames so far: vectors of numbers, one after the other, of which the oldest go. */
"use strict";

var HeelstrikeCourse = (() => {
  const MOST_FRAMES = 20000; // as on the server

  return class Course {
    /** `layout` says where in a frame each quantity begins and how many numbers it has. */
    constructor(layout) {
      this.layout = layout;
      this.width = layout.width;
      this.count = 0;
      this.numbers = new Float64Array(this.width * 4096);
    }
    add(numbers) {
      const more = numbers.length / this.width;
      if (this.count + more > 2 * MOST_FRAMES) {
        const kept = Math.max(Math.min(this.count, MOST_FRAMES - more), 0);
        this.numbers.copyWithin(0, (this.count - kept) * this.width, this.count * this.width);
        this.count = kept;
      }
      if ((this.count + more) * this.width > this.numbers.length) {
        const larger = new Float64Array(2 * (this.numbers.length + numbers.length));
        larger.set(this.numbers);
        this.numbers = larger;
      }
      this.numbers.set(numbers, this.count * this.width);
      this.count += more;
    }
    time(k) { return this.numbers[k * this.width]; }
    get end() { return this.count ? this.time(this.count - 1) : 0; }
    vector(k) { return this.numbers.subarray(k * this.width, (k + 1) * this.width); }
    /** Number of frames that are not later than t. */
    until(t) {
      let low = 0, high = this.count;
      while (low < high) {
        const middle = (low + high) >> 1;
        if (this.time(middle) <= t) low = middle + 1;
        else high = middle;
      }
      return low;
    }
    cut(t) { this.count = this.until(t); }

    /** One quantity of a frame. */
    field(vector, name) {
      const [begin, width] = this.layout.fields[name];
      return vector.subarray(begin, begin + width);
    }
    /** A frame as HeelstrikeDrawing has it. */
    frame(vector) {
      const frame = { time: vector[0] };
      for (const name of Object.keys(this.layout.fields))
        if (name !== "time") frame[name] = this.field(vector, name);
      return frame;
    }
    /** Stretches of time in which feet press: [from, to, foot]; the last ones have no end yet. */
    phases(weight) {
      const [begin, feet] = this.layout.fields.pressing, found = [];
      for (let foot = 0; foot < feet; foot++) {
        let since = null;
        for (let k = 0; k < this.count; k++) {
          const presses = this.numbers[k * this.width + begin + foot] > 1e-3 * weight;
          if (presses && since === null) since = this.time(Math.max(k - 1, 0));
          else if (!presses && since !== null) {
            found.push([since, this.time(k - 1), foot]);
            since = null;
          }
        }
        if (since !== null) found.push([since, Infinity, foot]);
      }
      return found;
    }
  };
})();
