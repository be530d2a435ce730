// Loaded before the C library (LD_PRELOAD): lets one system call on files below a folder fail.
//
// - FAULT_FOLDER: only files below it are looked at
// - FAULT_KIND: EIO, ENOSPC, EINTR, short (a write of half the bytes), hang (13 s); and from then on: full
//   (ENOSPC for all that takes room), slow (0.4 s); or held: no call returns while the file of FAULT_WHEN is there
// - FAULT_AT: which call, from 1; 0: none
// - FAULT_WHEN: instead of FAULT_AT, the first call once this file is there
// - FAULT_COUNT: file that gets the number of calls at the end; FAULT_COUNT.shared: the processes of a command count
//   together
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

enum { most_files = 4096 };
enum kind { none, fail, half, full, hang, slow, held };

static const char *folder, *when;
static enum kind kind;
static int error_number;
static long at;
static atomic_long own_count, *count = &own_count;
enum { not_looked_at, our_file, another_file };
static atomic_char ours[most_files];

static void count_together(const char* path) {
  char name[4096];
  snprintf(name, sizeof name, "%s.shared", path);
  const int file = (int)syscall(SYS_openat, AT_FDCWD, name, O_RDWR | O_CREAT, 0600);
  if (file < 0 || syscall(SYS_ftruncate, file, sizeof *count) != 0) return;
  void* memory = mmap(NULL, sizeof *count, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  if (memory != MAP_FAILED) count = memory;
  syscall(SYS_close, file);
}

__attribute__((constructor)) static void begin(void) {
  const char* name = getenv("FAULT_KIND");
  const char* place = getenv("FAULT_AT");
  folder = getenv("FAULT_FOLDER");
  when = getenv("FAULT_WHEN");
  if (folder == NULL || name == NULL || (place == NULL && when == NULL)) return;
  if (place != NULL) at = strtol(place, NULL, 10);
  kind = strcmp(name, "short") == 0  ? half
         : strcmp(name, "full") == 0 ? full
         : strcmp(name, "hang") == 0 ? hang
         : strcmp(name, "slow") == 0 ? slow
         : strcmp(name, "held") == 0 ? held
                                     : fail;
  if (getenv("FAULT_COUNT") != NULL) count_together(getenv("FAULT_COUNT"));
  error_number = strcmp(name, "EIO") == 0 ? EIO : strcmp(name, "EINTR") == 0 ? EINTR : ENOSPC;
}

__attribute__((destructor)) static void end(void) {
  const char* path = getenv("FAULT_COUNT");
  if (path == NULL) return;
  char text[32];
  const int length = snprintf(text, sizeof text, "%ld\n", atomic_load(count));
  const int file = (int)syscall(SYS_openat, AT_FDCWD, path, O_WRONLY | O_CREAT | O_TRUNC, 0600);
  if (file >= 0 && syscall(SYS_write, file, text, length) == length) syscall(SYS_close, file);
}

// Counts the call and says what becomes of it.
static enum kind fate(int takes_room) {
  if (kind == held) {
    while (when != NULL && faccessat(AT_FDCWD, when, F_OK, 0) == 0) usleep(1000);
    return none;
  }
  const long number = atomic_fetch_add(count, 1) + 1;
  if (when != NULL && at == 0 && faccessat(AT_FDCWD, when, F_OK, 0) == 0) at = number;
  if (at == 0 || number < at || (kind != full && kind != slow && number != at)) return none;
  if (kind == hang) sleep(13);
  if (kind == slow) usleep(400000);
  if (kind == hang || kind == slow) return none;
  return kind == full ? (takes_room ? fail : none) : kind;
}

static int fails(int takes_room) {
  if (fate(takes_room) != fail) return 0;
  errno = error_number;
  return 1;
}

static int is_ours(const char* path) {
  return folder != NULL && strncmp(path, folder, strlen(folder)) == 0;
}

// A file that another process has passed on was opened there.
static int is_our_file(int file) {
  if (folder == NULL || file < 0 || file >= most_files) return 0;
  if (ours[file] == not_looked_at) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    const ssize_t length = readlink(link, path, sizeof path - 1);
    path[length < 0 ? 0 : length] = 0;
    ours[file] = is_ours(path) ? our_file : another_file;
  }
  return ours[file] == our_file;
}

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

#define OPEN(name)                                                            \
  int name(const char* path, int flags, ...) {                                \
    va_list rest;                                                             \
    va_start(rest, flags);                                                    \
    const int mode = (flags & (O_CREAT | O_TMPFILE)) ? va_arg(rest, int) : 0; \
    va_end(rest);                                                             \
    const int counted = is_ours(path);                                        \
    if (counted && fails(flags & O_CREAT)) return -1;                         \
    const int file = NEXT(name)(path, flags, mode);                           \
    if (file >= 0 && file < most_files) ours[file] = counted ? our_file : another_file;           \
    return file;                                                              \
  }
OPEN(open)
OPEN(open64)

int close(int file) {
  if (file >= 0 && file < most_files) ours[file] = not_looked_at;
  return NEXT(close)(file);
}

ssize_t write(int file, const void* bytes, size_t size) {
  const enum kind what = is_our_file(file) ? fate(1) : none;
  if (what == fail) return errno = error_number, -1;
  return NEXT(write)(file, bytes, what == half && size > 1 ? size / 2 : size);
}

#define PWRITE(name, offset_type)                                                      \
  ssize_t name(int file, const void* bytes, size_t size, offset_type place) {          \
    const enum kind what = is_our_file(file) ? fate(1) : none;                         \
    if (what == fail) return errno = error_number, -1;                                 \
    return NEXT(name)(file, bytes, what == half && size > 1 ? size / 2 : size, place); \
  }
PWRITE(pwrite, off_t)
PWRITE(pwrite64, off64_t)

#define ON_FILE(name, takes_room)                          \
  int name(int file) {                                     \
    if (is_our_file(file) && fails(takes_room)) return -1; \
    return NEXT(name)(file);                               \
  }
ON_FILE(fsync, 1)
ON_FILE(fdatasync, 1)

int ftruncate(int file, off_t size) {
  if (is_our_file(file) && fails(0)) return -1;
  return NEXT(ftruncate)(file, size);
}
int ftruncate64(int file, off64_t size) {
  if (is_our_file(file) && fails(0)) return -1;
  return NEXT(ftruncate64)(file, size);
}
int rename(const char* from, const char* to) {
  if (is_ours(from) && fails(1)) return -1;
  return NEXT(rename)(from, to);
}
int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  if (is_ours(from) && fails(1)) return -1;
  return NEXT(renameat2)(from_folder, from, to_folder, to, flags);
}
int unlink(const char* path) {
  if (is_ours(path) && fails(0)) return -1;
  return NEXT(unlink)(path);
}
