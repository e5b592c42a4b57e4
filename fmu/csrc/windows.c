/* What zig's MinGW adds to Windows' own C library, ucrtbase.dll. It would compile all of MinGW before its first DLL, for
   minutes; with this file it links none of it, and the DLL needs nothing but ucrtbase.dll. Without headers, which zig has
   only where it links MinGW; vsnprintf, snprintf and the classes of numbers are as those of MinGW's headers. */

typedef unsigned long long size;
typedef __builtin_va_list values;

#define AS_IN_C99 2ULL /* returns the length that would be needed; always ends in a zero */

int __stdio_common_vsprintf(unsigned long long options, char *buffer, size count, const char *format, void *locale, values all);

int vsnprintf(char *buffer, size count, const char *format, values all)
{
    return __stdio_common_vsprintf(AS_IN_C99, buffer, count, format, 0, all);
}

int snprintf(char *buffer, size count, const char *format, ...)
{
    values all;
    __builtin_va_start(all, format);
    const int length = vsnprintf(buffer, count, format, all);
    __builtin_va_end(all);
    return length;
}

int __fpclassify(double x) { return __builtin_fpclassify(0x0100, 0x0500, 0x0400, 0x4400, 0x4000, x); }

/* Called before a frame of rax bytes: Windows commits a stack page after page, each when the one above has been touched. */
__asm__(".globl ___chkstk_ms\n"
        "___chkstk_ms:\n"
        "    push %rax\n"
        "    push %rcx\n"
        "    lea 24(%rsp), %rcx\n"
        "1:  cmp $4096, %rax\n"
        "    jbe 2f\n"
        "    sub $4096, %rcx\n"
        "    orb $0, (%rcx)\n"
        "    sub $4096, %rax\n"
        "    jmp 1b\n"
        "2:  sub %rax, %rcx\n"
        "    orb $0, (%rcx)\n"
        "    pop %rcx\n"
        "    pop %rax\n"
        "    ret\n");

/* The DLL's entry: there is nothing to prepare. */
int windows_entry(void *library, unsigned long reason, void *reserved)
{
    (void)library, (void)reason, (void)reserved;
    return 1;
}
