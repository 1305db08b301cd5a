"""What to do about a disk that refuses: each errno has its own remedy."""

from __future__ import annotations

import errno

ELSEWHERE = "choose another store with --store"
FULL = (errno.ENOSPC, errno.EDQUOT)  # where sizes are worth saying
REMEDIES = {
    "free some space": (errno.ENOSPC,),
    "remove files of yours: they fill your quota": (errno.EDQUOT,),
    "raise the limit of a file's size (ulimit -f)": (errno.EFBIG,),
    "raise the limit of open files (ulimit -n)": (errno.EMFILE, errno.ENFILE),
    "change its permissions": (errno.EACCES, errno.EPERM),
    "mount it for writing": (errno.EROFS,),
    "give it a shorter path": (errno.ENAMETOOLONG,),
    "look after its disk or its server": (errno.EIO, errno.ENXIO, errno.ENODEV, errno.ESTALE, errno.ETIMEDOUT),
    "move away what is there": (errno.ENOTDIR, errno.EISDIR, errno.EEXIST, errno.ELOOP),
}
BY_ERRNO = {code: what for what, codes in REMEDIES.items() for code in codes}


def remedy(error: OSError, elsewhere: str = ELSEWHERE) -> str:
    """What a user can do about ``error``; the last resort is to go ``elsewhere``."""
    what = BY_ERRNO.get(error.errno or 0)
    return f"{what}, or {elsewhere}" if what else elsewhere
