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
        if not line:
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


found = sorted(set(complaints()))
print("\n".join(found) or "no room includes one above it")
sys.exit(bool(found))
