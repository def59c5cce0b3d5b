"""Files of texts, as the program has them after it read them."""

from distretarget.io.files import encoded_parts, hash_of
from distretarget.io.input_file import InputFile
from distretarget.io.reading import TargetFile


def file_of(text, path):
    """A file with a text."""
    return InputFile(b"".join(encoded_parts(text)), path)


def target_of(text, path):
    """The target in a file with a text."""
    return TargetFile.of(file_of(text, path))


def named_target(text, path):
    """A target's file of which only path and content matter."""
    return TargetFile(None, path, file_of(text, path))


def text_hash(text):
    """The hash of a file with a text."""
    return hash_of(b"".join(encoded_parts(text)))
