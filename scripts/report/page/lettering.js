// The words of a picture on a canvas: put down last, over all else, and apart from each other.

const PLACES = [4, -8, 16, -20, 28, -32, 40].flatMap((down) => [[1, down], [-1, down]]); // right or left of its point, px

const overlap = (one, other) => {
  const common = (begin, end) => Math.max(0, Math.min(one[end], other[end]) - Math.max(one[begin], other[begin]));
  return common(0, 2) * common(1, 3);
};

// The words and what they shall not hide: boxes, [left, top, right, bottom].
function Lettering(pen, width, height) {
  const taken = [];
  pen.font = "12px system-ui, sans-serif";

  // How much of a box is hidden, or outside of the picture.
  const trouble = (box) => {
    const outside = (box[2] - box[0]) * (box[3] - box[1]) - overlap(box, [2, 2, width - 2, height - 2]);
    return taken.reduce((sum, other) => sum + overlap(box, other), 0) + 4 * outside;
  };

  return {
    keepOff(x, y, half) { taken.push([x - half, y - half, x + half, y + half]); },

    // A word beside its point, `gap` from it, at the place that hides the least, the first of several; what is far out
    // stays there.
    put(text, x, y, paint, paper, gap, places = PLACES) {
      if (x < 0 || x > width || y < 0 || y > height) return;
      const wide = pen.measureText(text).width;
      let best = null;
      for (const [side, down] of places) {
        const left = side > 0 ? x + gap : x - gap - wide, box = [left, y + down - 11, left + wide, y + down + 3], cost = trouble(box);
        if (!best || cost < best.cost) best = { cost, box, down };
        if (!cost) break;
      }
      taken.push(best.box);
      const at = Math.max(2, Math.min(best.box[0], width - wide - 2));
      pen.strokeStyle = paper; pen.lineWidth = 3; pen.lineJoin = "round";
      pen.strokeText(text, at, y + best.down);
      pen.fillStyle = paint;
      pen.fillText(text, at, y + best.down);
    },
  };
}
