#include "rls.c"

#define MODULE "identification.kernel._double"
#define INITIALISE PyInit__double
#include "python.c"
