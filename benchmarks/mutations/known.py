"""Mutations that once passed unseen, by hand."""

from __future__ import annotations

import ast
from pathlib import Path

from operators import Mutant

# File, what stands there (once), and what is put there.
KNOWN: tuple[tuple[str, str, str], ...] = (
    ("sim/record/recording.py", "-gap[contact])", "0.0)"),
    ("sim/record/recording.py", "max(tally.cone, residual[1])", "0.0"),
    ("sim/record/recording.py", "max(tally.cone, residual[1])", "residual[1]"),
    ("sim/dimension.py", "getattr(memory.solver.tally, name)", "0"),
    ("sim/dimension.py", "self.certificates(**{name: found[name] for name in self.worst})",
     "self.certificates(*(found[name] for name in reversed(self.worst)))"),
    ("analysis/told_summary.py", '"slip_max_m": max_slip(run)',
     '"slip_max_m": 1e3 * max_slip(run)'),
    ("analysis/summary.py", "UNKNOWN if tracking is None else tracking.rms",
     "UNKNOWN if tracking is None else math.degrees(tracking.rms)"),
    ("analysis/summary.py", "UNKNOWN if tracking is None else tracking.max",
     "UNKNOWN if tracking is None else math.degrees(tracking.max)"),
    ("analysis/summary.py", "zmp_margin_min_m=float(np.fmin.reduce(margin,",
     "zmp_margin_min_m=100.0 * float(np.fmin.reduce(margin,"),
    ("analysis/summary.py", "zmp_margin_min_m=float(np.fmin.reduce(margin,",
     "zmp_margin_min_m=float(np.fmax.reduce(margin,"),
    ("analysis/summary.py", "m in {s.duration_s:.4} s (", "m in {s.duration_s:.4} ms ("),
    ("sim/run.py", '"m/s or rad/s"', '"m/s or deg/s"'),
    ("sim/run.py", 'unit="N m or N", label="joint torques within their limits"',
     'unit="N", label="joint torques within their limits"'),
    ("sim/files/layout.py", '"window": ["start", "duration"]', '"window": ["start", "end"]'),
    ("sim/files/layout.py", '"component": ["normal", "tangent"]',
     '"component": ["tangent", "normal"]'),
    ("sim/files/dataset.py", '"N s"', '"N"'),
    ("sim/files/layout.py", '"axis": ["x", "z"]', '"axis": ["z", "x"]'),
    ("sim/contacts/candidates.py", "slip[contact] = answer.velocity[row + 1]",
     "slip[contact] = -answer.velocity[row + 1]"),
    ("sim/run.py", 'of="contacts.gap"', 'of="reaction.slip"'),
    ("sim/event_driven/rows.py", "            _, slip = gap_velocity(point,",
     "            slip, _ = gap_velocity(point,"),
    ("sim/compliant/dynamics.py",
     "slip[contact] = row_product(jacobian, 2 * contact + 1, v)\n            normal.",
     "slip[contact] = -row_product(jacobian, 2 * contact + 1, v)\n            normal."),
    ("sim/controller/stance.py", "        force[j] -= robot.passive[j]\n", "        pass\n"),
    ("gait/support.py", " - self.robot.model.contact_radius[contact]", ""),
    ("gait/support.py", "center - sole.radius * self.up", "center"),
)  # fmt: skip


def known_mutants(package: Path) -> list[Mutant]:
    """Return those whose text is still there.

    Raises
    ------
    ValueError
        If a text is not there, or not only there.
    """
    mutants = []
    for file, old, new in KNOWN:
        text = (package / file).read_text()
        if text.count(old) != 1:
            raise ValueError(f"{file} has {text.count(old)} times {old!r}")
        begin = text.index(old)
        line = text.count("\n", 0, begin) + 1
        inside = [
            node
            for node in ast.walk(ast.parse(text))
            if isinstance(node, ast.FunctionDef) and node.lineno <= line <= (node.end_lineno or 0)
        ]
        function, scope = 0, ""
        if inside:
            innermost = max(inside, key=lambda node: node.lineno)
            scope = innermost.name
            function = min([innermost.lineno, *(d.lineno for d in innermost.decorator_list)])
        end = begin + len(old)
        mutants.append(Mutant(file, line, function, scope, begin, end, old, new, "known"))
    return mutants
