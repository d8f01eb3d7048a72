#pragma once

namespace mapmend {

// The style sheet of report.html.
inline constexpr char kReportStyle[] = R"css(
:root { --ink: #1f2933; --muted: #6b7785; --line: #e3e8ed; --good: #1b7f4b; --warn: #b25e00; --bad: #b3202a; }
* { box-sizing: border-box; }
body { margin: 0; background: #f3f5f8; color: var(--ink); font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", Arial, sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 28px 20px 60px; }
header h1 { margin: 0; font-size: 26px; }
header p { margin: 2px 0 0; color: var(--muted); overflow-wrap: anywhere; }
h2 { margin: 34px 0 10px; font-size: 19px; }
.banner { display: flex; flex-wrap: wrap; gap: 4px 18px; align-items: baseline; margin: 20px 0; padding: 16px 20px; border-radius: 10px;
  background: #fff; border-left: 8px solid var(--good); box-shadow: 0 1px 3px #0001; }
.banner b { font-size: 21px; color: var(--good); }
.banner.warn { border-color: var(--warn); } .banner.warn b { color: var(--warn); }
.banner.bad { border-color: var(--bad); } .banner.bad b { color: var(--bad); }
.figures { display: grid; grid-template-columns: repeat(auto-fill, minmax(122px, 1fr)); gap: 12px; }
.figure { background: #fff; border-radius: 10px; padding: 12px 13px; box-shadow: 0 1px 3px #0001; display: flex; flex-direction: column; }
.figure b { font-size: 20px; white-space: nowrap; line-height: 1.25; } .figure span { font-size: 13px; }
.figure i { font-style: normal; font-size: 12px; color: var(--muted); }
.picture { margin-top: 20px; padding: 8px; background: #fff; border-radius: 10px; overflow-x: auto; box-shadow: 0 1px 3px #0001; }
.picture svg { display: block; }
.scroll { overflow-x: auto; background: #fff; border-radius: 10px; box-shadow: 0 1px 3px #0001; }
table { border-collapse: collapse; width: 100%; font-size: 14px; }
th, td { padding: 7px 9px; text-align: right; white-space: nowrap; border-bottom: 1px solid var(--line); vertical-align: top; }
tr:last-child td { border-bottom: 0; }
th { font-size: 12px; font-weight: 600; color: var(--muted); }
th:first-child, td:first-child, .text, .left { text-align: left; }
td.text { white-space: normal; min-width: 130px; } td.text:last-child { min-width: 165px; }
td i { font-style: normal; font-size: 13px; color: var(--muted); }
.chip { display: inline-block; min-width: 22px; padding: 0 5px; border-radius: 11px; color: #fff; font-weight: 600; font-size: 13px;
  line-height: 22px; text-align: center; }
.verdict { padding: 2px 8px; border-radius: 9px; font-size: 12.5px; background: #edf0f3; white-space: nowrap; }
.verdict.tree { background: #d9f0e3; color: #14603a; font-weight: 600; } .verdict.accepted { background: #e3ecfa; color: #234f9c; }
.verdict.deactivated { background: #fbe3e4; color: var(--bad); }
.why li { margin-bottom: 8px; }
.note, footer { font-size: 13px; color: var(--muted); }
footer { margin-top: 40px; }
@media print { body { background: #fff; } .figure, .picture, .scroll, .banner { box-shadow: none; border: 1px solid var(--line); } }
)css";

}  // namespace mapmend
