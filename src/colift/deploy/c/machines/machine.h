// What the driver needs of a machine: two files, a counter of instructions, and how much of the stack was used.

#ifndef MACHINE_H
#define MACHINE_H

void machine_begin(void);
void machine_take(void *to, int bytes);         // the next bytes of calls.bin
void machine_give(const void *from, int bytes); // more bytes of answers.bin
double machine_instructions(void);              // so far; 0 where nobody counts
void machine_paint(void);                       // mark the free part of the stack
int machine_used(void);                         // bytes of it below the caller that are marked no more
void machine_end(void);

#endif
