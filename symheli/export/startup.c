/* Start of a check program on an emulated MPS2 board (qemu-system-arm), and what a step of it
   takes: instructions by a timer, stack by painting it. No part of what flies. */
#include "measure.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define TIMER_CONTROL REGISTER(0x40000000u) /* counts down at 25 MHz */
#define TIMER_NOW REGISTER(0x40000004u)
#define TIMER_RELOAD REGISTER(0x40000008u)
#define COPROCESSORS REGISTER(0xE000ED88u)

enum { PAINTED = 8192, PAINT = 0x5A5A5A5A };

extern uint32_t stack_top[], data_start[], data_end[], bss_start[], bss_end[];
extern const uint32_t data_load[];
extern void initialise_monitor_handles(void);
int main(void);
void reset(void);
void _init(void);
void _fini(void);

/* newlib calls them at exit; nothing is constructed here */
void _init(void) {}
void _fini(void) {}

static void fault(void)
{
    /* semihosting: exit, for a run-time error */
    register uint32_t operation __asm("r0") = 0x18, reason __asm("r1") = 0x20023;
    __asm volatile("bkpt 0xab" : : "r"(operation), "r"(reason) : "memory");
    for (;;) {
    }
}

__attribute__((section(".vectors"), used)) static void (*const vectors[16])(void) = {
    (void (*)(void))stack_top, reset, fault, fault, fault, fault, fault};

static uint32_t *caller, begun, ticks, steps, most, deepest;
static uint64_t total;

__attribute__((noinline)) void measure_begin(void)
{
    uint32_t *here;
    caller = __builtin_dwarf_cfa();
    __asm volatile("mov %0, sp" : "=r"(here));
    for (volatile uint32_t *word = here; word > caller - PAINTED;) *--word = PAINT;
    TIMER_CONTROL = 0;
    TIMER_RELOAD = UINT32_MAX;
    TIMER_CONTROL = 1;
    begun = TIMER_NOW;
}

__attribute__((noinline)) int measure_end(int said)
{
    const uint32_t *word = caller - PAINTED;
    ticks = begun - TIMER_NOW;
    while (word < caller && *word == PAINT) word++;
    if ((uint32_t)(caller - word) > deepest) deepest = (uint32_t)(caller - word);
    if (ticks > most) most = ticks;
    total += ticks;
    steps++;
    return said;
}

/* With -icount shift=6 an instruction is 64 ns, and a tick of the timer 40 ns: the rehearsal tells
   whether it is so. */
static uint32_t instructions(uint64_t counted) { return (uint32_t)((5 * counted + 4) / 8); }

static void report(void)
{
    const uint32_t counted = steps, largest = most, stack = 4 * deepest;
    const uint64_t sum = total;
    uint32_t nothing;
    if (counted == 0) return;
    measure_begin();
    measure_end(0);
    nothing = ticks;
    measure_begin();
    __asm volatile(".rept 1000\n nop\n .endr");
    measure_end(0);
    if (instructions(ticks - nothing) != 1000)
        printf("instructions: counted by qemu-system-arm with -icount shift=6 only\n");
    else
        printf("instructions a step: mean %lu, most %lu of %lu steps\n",
               (unsigned long)instructions(sum / counted - nothing),
               (unsigned long)instructions(largest - nothing), (unsigned long)counted);
    printf("stack of a step: %lu bytes\n", (unsigned long)stack);
}

static __attribute__((noinline, noreturn)) void run(void)
{
    int status;
    const uint32_t *from = data_load;
    for (uint32_t *to = data_start; to < data_end;) *to++ = *from++;
    for (uint32_t *to = bss_start; to < bss_end;) *to++ = 0;
    initialise_monitor_handles();
    status = main();
    report();
    exit(status);
}

void reset(void)
{
    COPROCESSORS |= 0xFu << 20; /* before the first instruction of the floating-point unit */
    __asm volatile("dsb\n isb" : : : "memory");
    run();
}
