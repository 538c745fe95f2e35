#define RLS_SINGLE
#include "rls.c"

#define MODULE "identification.kernel._single"
#define INITIALISE PyInit__single
#include "python.c"
