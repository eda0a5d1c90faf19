"""How easily src/ reads, in numbers: python3 tests/counts.py [folder].

Functions are found by indentation, which rustfmt guarantees; tests are left out.
"""

import pathlib
import re
import sys

root = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "src")
lines_over, opaque, stringly, closures, longest_file = 0, [], 0, 0, (0, "")
code_lines, code_characters, comments, functions = 0, 0, 0, []

for path in sorted(root.rglob("*.rs")):
    if "tests" in path.parts or path.name == "tests.rs":
        continue
    text = path.read_text().split("#[cfg(test)]\nmod tests {")[0]
    lines = text.splitlines()
    longest_file = max(longest_file, (len(lines), str(path)))
    start = None
    for number, line in enumerate(lines):
        stripped = line.strip()
        lines_over += len(line) > 100
        if re.match(r"//[/!] What ", stripped) and not lines[number - 1].strip().startswith("//"):
            opaque.append(f"{path}:{number + 1}")
        if not stripped.startswith("//"):
            stringly += len(re.findall(r"Result<[^;{=]*, String>", stripped))
            closures += bool(re.match(r"let (mut )?\w+ = (move )?\|", stripped))
            if stripped:
                code_lines += 1
                code_characters += len(stripped)
        if start is None and re.match(r"\s*(pub(\([^)]*\))? )?(const )?(unsafe )?fn ", line):
            start, indent = number, len(line) - len(line.lstrip())
        elif start is not None and line == " " * indent + "}":
            body = lines[start : number + 1]
            remarks = sum(inner.strip().startswith("// ") for inner in body)
            functions.append((len(body), remarks, f"{path}:{start + 1}"))
            start = None

long = [function for function in functions if function[0] > 40]
print(f"{code_lines:6} lines of code, of {code_characters / code_lines:.1f} characters")
print(f"{lines_over:6} lines beyond 100 columns")
print(f"{longest_file[0]:6} lines in the longest file, {longest_file[1]}")
print(f"{max(functions)[0]:6} lines in the longest function, {max(functions)[2]}")
print(f"{len(long):6} functions beyond 40 lines")
print(f"{sum(f[1] for f in long) / sum(f[0] for f in long):6.3f} comments a line of theirs")
print(f"{closures:6} named closures")
print(f"{stringly:6} results whose error is a String")
print(f"{len(opaque):6} docs that begin with What")
