import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { useSize } from "../hooks";

export interface Curve {
  name: string;
  values: (number | null)[];
  colour: string; // name of a CSS variable
  bars?: boolean;
  dash?: number[];
}

// Curves over one axis. Text beside it says what the picture says, for those who cannot see it.
export function Plot({ label, x, xLabel, yLabel, curves, height = 200, names, fromZero = false }: {
  label: string;
  x: number[];
  xLabel: string;
  yLabel: string;
  curves: Curve[];
  height?: number;
  names?: string[]; // of the points, in place of numbers
  fromZero?: boolean;
}) {
  const [box, size] = useSize<HTMLDivElement>();
  const plot = useRef<uPlot | null>(null);
  const width = Math.floor(size.width);
  const theme = document.documentElement.dataset.theme;
  useEffect(() => {
    if (!box.current || width < 50) return undefined;
    const css = getComputedStyle(document.documentElement);
    const variable = (name: string) => css.getPropertyValue(name).trim();
    const axis = { stroke: variable("--dim"), grid: { stroke: variable("--line"), width: 1 }, ticks: { stroke: variable("--line"), width: 1 }, font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif", labelSize: 18 };
    const chart = new uPlot(
      {
        width,
        height,
        legend: { show: curves.length > 1 },
        cursor: { drag: { x: false, y: false } },
        scales: { x: { time: false, range: names ? [-0.6, names.length - 0.4] : undefined }, y: fromZero ? { range: (_u, _low, high) => [0, (high || 1) * 1.08] } : {} },
        axes: [
          names
            ? { ...axis, label: xLabel, splits: () => names.map((_, i) => i), values: () => names, rotate: names.length > 8 ? -60 : 0, size: names.length > 8 ? 56 : 40 }
            : { ...axis, label: xLabel, size: 34 },
          { ...axis, label: yLabel, size: 58 },
        ],
        series: [
          { label: xLabel, value: (_u, v: number | null) => (v === null ? "–" : names ? (names[v] ?? "") : v.toPrecision(4)) },
          ...curves.map((curve) => ({
            label: curve.name,
            stroke: variable(curve.colour),
            width: 2,
            dash: curve.dash,
            fill: curve.bars ? `${variable(curve.colour)}66` : undefined,
            paths: curve.bars ? uPlot.paths.bars?.({ size: [0.6, 60] }) : undefined,
            points: { show: false },
            value: (_u: uPlot, v: number | null) => (v === null || v === undefined ? "–" : v.toPrecision(4)),
          })),
        ],
      },
      [x, ...curves.map((curve) => curve.values)] as uPlot.AlignedData,
      box.current,
    );
    plot.current = chart;
    return () => chart.destroy();
  }, [width, height, theme, JSON.stringify([x.length, curves.map((c) => [c.name, c.values.length])])]);
  useEffect(() => plot.current?.setData([x, ...curves.map((curve) => curve.values)] as uPlot.AlignedData), [x, curves]);
  return <div class="plot" role="img" aria-label={label} ref={box} />;
}
