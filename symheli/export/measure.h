/* MEASURED(call): a call that returns an int, its instructions and its stack; see startup.c. */
#ifndef MEASURE_H
#define MEASURE_H

void measure_begin(void);
int measure_end(int said);

#define MEASURED(call) (measure_begin(), measure_end(call))

#endif
