"""No room includes one above it: reads every #include "..." and compares with rooms.txt. rooms.py SOURCE_FOLDER"""
import pathlib
import re
import sys

source = pathlib.Path(sys.argv[1])


def stated():
    """{folder: {room: the rooms that it may include}}"""
    below = {}
    for line in (pathlib.Path(__file__).parent / "rooms.txt").read_text().splitlines():
        line = line.partition("#")[0].strip()
        if not line or " reaches:" in line:
            continue
        folder, _, levels = line.partition(":")
        rooms = below.setdefault(folder.strip(), {})
        lower = []
        for level in levels.split("<"):
            for room in level.split():
                rooms.setdefault(room, set()).update(lower)
            lower = level.split()
    for rooms in below.values():
        for _ in rooms:  # what is below one that is below
            for under in rooms.values():
                under.update(*[rooms[room] for room in under])
    return below


def reached():
    """{folder: the folders that all that it needs lies in}"""
    out = {}
    for line in (pathlib.Path(__file__).parent / "rooms.txt").read_text().splitlines():
        folder, reaches, folders = line.partition("#")[0].partition(" reaches:")
        if reaches:
            out.setdefault(folder.strip(), set()).update(folders.split())
    return out


def included_by(path):
    for line in path.read_text().splitlines():
        found = re.match(r'\s*#\s*include\s*"([^"]+)"', line)
        if found:
            yield pathlib.Path(found[1])


def strays():
    for folder, allowed in reached().items():
        todo = {p.relative_to(source): None for p in (source / folder).iterdir() if p.suffix in (".h", ".cpp")}
        seen = dict(todo)
        while todo:
            file, _ = todo.popitem()
            if str(file.parent) not in allowed:
                yield f"{folder} must not reach {file}, which {seen[file]} needs"
                continue
            for header in included_by(source / file):
                for found in (header, header.with_suffix(".cpp")):
                    if found not in seen and (source / found).is_file():
                        seen[found] = todo[found] = file
        if len(seen) < 20:
            yield f"rooms.txt: only {len(seen)} files were reached from {folder}"


def room_of(file, folder):
    """The room of the folder that the file lies in: None for another folder's, "" for none of its rooms."""
    parts = file.parts if folder == "." else file.relative_to(folder).parts if file.is_relative_to(folder) else ()
    return None if not parts else parts[0] if len(parts) > 1 else ""


def complaints():
    rules = stated()
    for folder, rooms in rules.items():
        for room, below in rooms.items():
            if room in below:
                yield f"rooms.txt: {folder}: {room} is above itself"
            if not (source / folder / room).is_dir():
                yield f"rooms.txt: {folder}: there is no {room}"
    seen = 0
    for path in sorted(p for folder in rules["."] for p in (source / folder).rglob("*") if p.suffix in (".h", ".cpp")):
        if "node_modules" in path.parts:
            continue
        file = path.relative_to(source)
        for folder, rooms in rules.items():
            room = room_of(file, folder)
            if room and room not in rooms:
                yield f"{file}: {folder} has no room {room} in rooms.txt"
        for number, line in enumerate(path.read_text().splitlines(), 1):
            found = re.match(r'\s*#\s*include\s*"([^"]+)"', line)
            if not found:
                continue
            seen += 1
            included = pathlib.Path(found[1])
            if not (source / included).is_file():
                yield f"{file}:{number}: there is no {included}: a path begins at the top of the project"
            for folder, rooms in rules.items():
                room, other = room_of(file, folder), room_of(included, folder)
                if room is None or other is None or room in ("", other):
                    continue
                if other not in rooms.get(room, ()):
                    yield f"{file}:{number}: {folder}: {room} must not include {other or 'what lies in no room'} ({included})"
    if seen < 500:
        yield f"only {seen} lines of #include were found"


found = sorted({*complaints(), *strays()})
print("\n".join(found) or "no room includes one above it")
sys.exit(bool(found))
