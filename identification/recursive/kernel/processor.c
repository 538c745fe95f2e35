/* Which of the levels the kernel is compiled for this processor, and its operating system, can run:
   made for any of its kind. */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#include <Python.h>

#if defined(__GNUC__) && defined(__x86_64__)
#define HAS(feature) (__builtin_cpu_supports(feature) != 0)
static int avx2(void) { return HAS("avx2"); }
static int avx512(void)
{
    return avx2() && HAS("avx512f") && HAS("avx512bw") && HAS("avx512dq") && HAS("avx512vl");
}
static void look(void) { __builtin_cpu_init(); }
#else
static int avx2(void) { return 0; }
static int avx512(void) { return 0; }
static void look(void) {}
#endif

static PyObject *levels(PyObject *module, PyObject *unused)
{
    (void)module, (void)unused;
    look();
    return avx512() ? Py_BuildValue("(sss)", "avx512", "avx2", "baseline")
           : avx2() ? Py_BuildValue("(ss)", "avx2", "baseline")
                    : Py_BuildValue("(s)", "baseline");
}

static PyMethodDef methods[] = {
    {"levels", levels, METH_NOARGS, "Names of the levels that run here, the fastest first."},
    {NULL, NULL, 0, NULL},
};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "_processor", "What this processor can run.", 0, methods,
    NULL, NULL, NULL, NULL,
};

PyMODINIT_FUNC PyInit__processor(void) { return PyModule_Create(&definition); }
