"""What helps against errors whose messages say only the cause; a gap, …, stands for what differs."""

NAMES = "one of the names in the message, the nearest or all there are; `distretarget skeleton show` lists joints"
EXPORT = "export the file again from the program that made it"
CHECK = "check the arrays that are given to `Skeleton` or `Motion`; the shapes that fit are in the message"
SOLVER = "a fault of this program: report it with the clip and the target; nothing has been written"

NOT_MESSAGES = frozenset(  # raised, but never seen by a user as they are
    {
        "module … has no attribute …",
        "… is not private",
        "found … values",
        "found fractions",
        "…: …",
        "…, expected …",
        "no representation …; there are …",
    }
)
CURES = {
    # files
    "there is no such file": "check the path, from the folder that you are in; quote names with blanks",
    "is a folder": "name a file in it, or use `distretarget batch` for all clips of a folder",
    "permission denied": "ask the owner of the file or folder for permission, or use another folder",
    "the disk is full": "free some space and run again; nothing is left half written",
    "the disk quota is used up": "free some of your space and run again; nothing is left half written",
    "is closed": "redirect a file to standard input, or name the file instead of `-`",
    "is not a text file: character … is NUL": "name a BVH or JSON file; convert FBX, glTF or C3D with Blender first",
    "is …, expected BVH; …": "convert it first, with Blender: File > Import, then File > Export > Motion Capture",
    "is empty": EXPORT,
    "permission denied to write into the folder …": "choose another folder, or ask its owner for permission",
    "is not a regular file": "name a file instead of a device, pipe or socket; `-o -` writes to standard output",
    "permission denied: the file is write-protected": "allow writing, `chmod u+w`, or choose another name",
    "there is no folder …": "make the folder first, or check its name",
    "begins with a UTF-16 mark, but is not valid UTF-16: …": f"save it as UTF-8, or {EXPORT}",
    "the output is …, so its name has to end in …, such as …": "use the name in the message; on a terminal, say yes",
    "- is standard …, which can stand for one file only.": "name files for the others",
    # BVH
    "a position or rotation is not finite and cannot be written": "look for NaN in the arrays of the motion",
    # scenes
    "… is held by …, which drives no joint of the target": (
        "name a joint of the performer's clip that drives one of the target; `distretarget skeleton match` lists them"
    ),
    "no performer …; …": NAMES,
    "Missing option '-t' / '--target', or name one SCENE.json.": "add `-t TARGET`, or put all of it into a scene file",
    "… belongs in the scene file.": "write it into the scene file, which has a key for it",
    "has no BVH file and no … in it": "name a folder with a file for each performer, or a scene file",
    "has no … in it or below": "name a scene file, or a folder with one in it",
    # skeleton files and maps
    "is not valid JSON: …": "mend the text at the line and column in the message; editors for JSON show the place",
    "unknown key; …": NAMES,
    'has no "joints"': 'add "joints", or leave out "units", "up" and "map", which belong to a whole skeleton',
    "the root cannot be an End Site": 'remove "end" from the first joint',
    "the root must be the first joint": "move the joint whose parent is null to the front",
    "no joint …; …": NAMES,
    "an End Site has no channels": 'remove "channels" or "end"',
    "unknown channel …; …": "one of the channels in the message",
    "… is an End Site, which has no children": 'remove its "end", or give the joint another parent',
    "the target has no such joint; …": NAMES,
    "the source has no joint …; …": NAMES,
    "no such joint; …": NAMES,
    "… …: no such bone; …": NAMES,
    "the bone has length 0 in the source, so it has no direction": "use a whole skeleton, which has an offset for it",
    # skeletons and motions
    "… has a channel twice: …": "name each channel once",
    "… has the unknown channel …; …": "one of the channels in the message",
    "a keyframe of … has a position or rotation that is not finite, or no rotation": "read the file again with bvhio",
    "a position or rotation is not finite, or beyond …, the most that bvhio holds": "use larger units",
    "this needs the package bvhio: pip install bvhio, with Python 3.13 or older (it has no builds for 3.14)": (
        "install bvhio, or use files instead of its containers"
    ),
    "… frames of root_positions, … of rotations": CHECK,
    "the rotation … is not a unit quaternion: …": "divide the quaternions, x y z w, by their lengths",
    "… has shape …, … joints need …": CHECK,
    "… is not an array of numbers: …": CHECK,
    "… is not an array of … values: …": CHECK,
    "the offset of … is not finite, or beyond …": "correct the offset or the scale, or use larger units",
    "channels are given for … of … joints": CHECK,
    "a skeleton needs a root as its first joint": "give the first joint the parent -1",
    "parents must come before their children, and only the root has none": "order the joints from the root outwards",
    "lengths have to be … numbers, from 0": CHECK,
    "names and channels need an entry for each joint: …": CHECK,
    "… is an End Site, but it is the root, or has channels or children": "clear its entry of `end_sites`",
    # retargeting
    "the result has … frames, the source …; …": SOLVER,
    "frame … of the result is wrong: … …; …": f"where the message says no more, {SOLVER}",
    # batches
    "there are no clips to convert": "name folders with .bvh files, and check --include and --exclude",
    "no Dask scheduler answers at … within … s": "check address and port, and whether the scheduler runs",
    "no Dask scheduler answers at …: …": "check the address, tcp://HOST:PORT, and whether the scheduler runs",
    "--dask needs the package distributed: pip install 'distretarget[dask]'": "install it, or leave out --dask",
    "nothing can be written to …": "name another file for the page",
    "stopped at the first failure: …": "mend the clip that is named, or leave out --fail-fast",
    "the workers die as they start; …": "put the code that converts below `if __name__ == '__main__':`",
    "the folder cannot be made: …": "choose another folder of results, or ask for permission",
    "…: there is no such file or folder.": "check the path, from the folder that you are in",
}
