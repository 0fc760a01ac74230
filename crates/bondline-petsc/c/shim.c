/* What bondline sees of PETSc and MPI: ints, doubles and opaque pointers. Compiled against the headers of the installation at hand, so that handles, enumerations and
 * PetscInt (32 or 64 bits) are the compiler's business, with OpenMPI or MPICH. Every function returns zero, or PETSc's code of an error whose text bl_message has. */
#include <petscksp.h>
#include <stdlib.h>
#include <string.h>

_Static_assert(sizeof(PetscScalar) == sizeof(double), "a PETSc of real doubles is wanted");

#define OK(e)                                                                                                          \
  do {                                                                                                                 \
    int bl_e = (int)(e);                                                                                               \
    if (bl_e) return bl_e;                                                                                             \
  } while (0)

static char text[4096];

/* keeps what PETSc says of an error, the innermost message first */
static PetscErrorCode keep(MPI_Comm c, int line, const char *function, const char *file, PetscErrorCode n, PetscErrorType p, const char *message, void *ctx) {
  (void)c; (void)line; (void)file; (void)ctx;
  if (p == PETSC_ERROR_INITIAL) {
    strncpy(text, function ? function : "PETSc", sizeof text - 1);
    if (message) {
      strncat(text, ": ", sizeof text - 1 - strlen(text));
      strncat(text, message, sizeof text - 1 - strlen(text));
    }
  }
  return n;
}

const char *bl_message(void) { return text; }

/* collective; threads call one at a time */
int bl_start(int *rank, int *size, int *threads) {
  int level = 0;
  /* else Scotch takes all cores, and cuts a graph differently each time */
  setenv("SCOTCH_PTHREAD_NUMBER", "1", 0);
  OK(MPI_Init_thread(NULL, NULL, MPI_THREAD_SERIALIZED, &level));
  *threads = level >= MPI_THREAD_SERIALIZED;
  OK(PetscInitialize(NULL, NULL, NULL, NULL));
  OK(PetscPopSignalHandler());
  OK(PetscPushErrorHandler(keep, NULL));
  OK(MPI_Comm_rank(PETSC_COMM_WORLD, rank));
  return MPI_Comm_size(PETSC_COMM_WORLD, size);
}

int bl_stop(void) {
  OK(PetscFinalize());
  return MPI_Finalize();
}

void bl_abort(int code) { MPI_Abort(MPI_COMM_WORLD, code); }

int bl_counts(int own, int *all) { return MPI_Allgather(&own, 1, MPI_INT, all, 1, MPI_INT, PETSC_COMM_WORLD); }

int bl_gather(const double *own, int n, double *all, const int *counts, const int *starts) {
  return MPI_Allgatherv(own, n, MPI_DOUBLE, all, counts, starts, MPI_DOUBLE, PETSC_COMM_WORLD);
}

int bl_gather_words(const unsigned long long *own, int n, unsigned long long *all, const int *counts, const int *starts) {
  return MPI_Allgatherv(own, n, MPI_UNSIGNED_LONG_LONG, all, counts, starts, MPI_UNSIGNED_LONG_LONG, PETSC_COMM_WORLD);
}

/* each number the sum of those of all ranks */
int bl_add(long long *sums, int n) { return MPI_Allreduce(MPI_IN_PLACE, sums, n, MPI_LONG_LONG, MPI_SUM, PETSC_COMM_WORLD); }

/* the part of each vertex, in this process alone; -1 where PETSc has no PT-Scotch */
int bl_parts(int n, const int *starts, const unsigned *neighbours, int parts, unsigned *of) {
#ifdef PETSC_HAVE_PTSCOTCH
  PetscInt *i, *j, *w;
  const PetscInt *p;
  Mat graph;
  MatPartitioning cut;
  IS is;
  OK(PetscMalloc1((size_t)n + 1, &i));
  OK(PetscMalloc1((size_t)starts[n] + 1, &j));
  OK(PetscMalloc1((size_t)n + 1, &w));
  for (int k = 0; k <= n; k++) i[k] = starts[k];
  for (int k = 0; k < starts[n]; k++) j[k] = (PetscInt)neighbours[k];
  for (int k = 0; k < n; k++) w[k] = 1 + starts[k + 1] - starts[k];
  /* the lists are the objects' from here on */
  OK(MatCreateMPIAdj(PETSC_COMM_SELF, n, n, i, j, NULL, &graph));
  OK(MatPartitioningCreate(PETSC_COMM_SELF, &cut));
  OK(MatPartitioningSetAdjacency(cut, graph));
  OK(MatPartitioningSetVertexWeights(cut, w));
  OK(MatPartitioningSetType(cut, MATPARTITIONINGPTSCOTCH));
  OK(MatPartitioningSetNParts(cut, parts));
  OK(MatPartitioningApply(cut, &is));
  OK(ISGetIndices(is, &p));
  for (int k = 0; k < n; k++) of[k] = (unsigned)p[k];
  OK(ISRestoreIndices(is, &p));
  OK(ISDestroy(&is));
  OK(MatPartitioningDestroy(&cut));
  return (int)MatDestroy(&graph);
#else
  (void)n, (void)starts, (void)neighbours, (void)parts, (void)of;
  return -1;
#endif
}

/* `mine` blocks of this rank and those of others that it wants, by their numbers over all ranks */
int bl_ghosts(int bs, int mine, int n, const long long *wanted, Vec *out) {
  PetscInt *w = malloc(((size_t)n + 1) * sizeof *w);
  if (!w) return PETSC_ERR_MEM;
  for (int i = 0; i < n; i++) w[i] = (PetscInt)wanted[i];
  int e = (int)VecCreateGhostBlock(PETSC_COMM_WORLD, bs, (PetscInt)bs * mine, PETSC_DETERMINE, n, w, out);
  free(w);
  return e;
}

int bl_ghosts_begin(Vec v, const double *own, int n) {
  PetscScalar *p;
  OK(VecGetArray(v, &p));
  memcpy(p, own, (size_t)n * sizeof *p);
  OK(VecRestoreArray(v, &p));
  return (int)VecGhostUpdateBegin(v, INSERT_VALUES, SCATTER_FORWARD);
}

/* `mine` numbers of this rank come before the `n` that are wanted */
int bl_ghosts_end(Vec v, int mine, double *wanted, int n) {
  Vec all;
  const PetscScalar *p;
  OK(VecGhostUpdateEnd(v, INSERT_VALUES, SCATTER_FORWARD));
  OK(VecGhostGetLocalForm(v, &all));
  OK(VecGetArrayRead(all, &p));
  memcpy(wanted, p + mine, (size_t)n * sizeof *p);
  OK(VecRestoreArrayRead(all, &p));
  return (int)VecGhostRestoreLocalForm(v, &all);
}

void bl_ghosts_free(Vec v) { VecDestroy(&v); }

/* overwrites y with the own rows times x, both of this rank; collective */
typedef void (*Product)(void *of, const double *x, double *y);

/* `a` is what is preconditioned with, and what is solved with where there is no product */
typedef struct {
  Mat a, shell;
  Vec b, x;
  KSP ksp;
  int bs, mine;
  Product product;
  void *of;
} Bl;

void bl_free(Bl *s) {
  if (!s) return;
  KSPDestroy(&s->ksp);
  VecDestroy(&s->b);
  VecDestroy(&s->x);
  MatDestroy(&s->shell);
  MatDestroy(&s->a);
  free(s);
}

/* `own` and `other`: blocks of each row in columns of this rank and of others */
int bl_matrix(int bs, int mine, const int *own, const int *other, int symmetric, Bl **out) {
  Bl *s = calloc(1, sizeof *s);
  PetscInt *d = malloc(2 * ((size_t)mine + 1) * sizeof *d);
  if (!s || !d) return PETSC_ERR_MEM;
  for (int i = 0; i < mine; i++) {
    d[i] = own[i];
    d[mine + i] = other[i];
  }
  s->bs = bs;
  s->mine = mine;
  *out = s;
  OK(MatCreate(PETSC_COMM_WORLD, &s->a));
  OK(MatSetSizes(s->a, (PetscInt)bs * mine, (PetscInt)bs * mine, PETSC_DETERMINE, PETSC_DETERMINE));
  OK(MatSetType(s->a, MATAIJ)); /* GAMG takes no blocks, but knows their size */
  OK(MatSetBlockSize(s->a, bs));
  OK(MatSetFromOptions(s->a));
  OK(MatXAIJSetPreallocation(s->a, bs, d, d + mine, NULL, NULL));
  OK(MatSetOption(s->a, MAT_NO_OFF_PROC_ENTRIES, PETSC_TRUE));
  OK(MatSetOption(s->a, MAT_SYMMETRIC, symmetric ? PETSC_TRUE : PETSC_FALSE));
  free(d);
  return 0;
}

/* one block row: `strip` has bs rows of bs * n numbers */
int bl_row(Bl *s, long long row, int n, const long long *columns, const double *strip) {
  PetscInt r = (PetscInt)row, *c = malloc(((size_t)n + 1) * sizeof *c);
  if (!c) return PETSC_ERR_MEM;
  for (int i = 0; i < n; i++) c[i] = (PetscInt)columns[i];
  int e = (int)MatSetValuesBlocked(s->a, 1, &r, n, c, strip, INSERT_VALUES);
  free(c);
  return e;
}

static PetscErrorCode multiply(Mat m, Vec x, Vec y) {
  Bl *s;
  const PetscScalar *p;
  PetscScalar *q;
  OK(MatShellGetContext(m, &s));
  OK(VecGetArrayRead(x, &p));
  OK(VecGetArray(y, &q));
  s->product(s->of, p, q);
  OK(VecRestoreArray(y, &q));
  return VecRestoreArrayRead(x, &p);
}

/* solves with a product, whose matrix is no one's */
int bl_shell(Bl *s, Product product, void *of) {
  PetscInt n = (PetscInt)s->bs * s->mine;
  s->product = product;
  s->of = of;
  OK(MatCreateShell(PETSC_COMM_WORLD, n, n, PETSC_DETERMINE, PETSC_DETERMINE, s, &s->shell));
  OK(MatSetBlockSize(s->shell, s->bs));
  OK(MatSetOption(s->shell, MAT_SYMMETRIC, PETSC_TRUE));
  return (int)MatShellSetOperation(s->shell, MATOP_MULT, (void (*)(void))multiply);
}

/* the finest level goes by the product, coarser ones by the matrix */
static int smooth_by_product(Bl *s) {
  PC pc;
  KSP smoother;
  PetscBool is_mg;
  PetscInt levels;
  OK(KSPGetPC(s->ksp, &pc));
  OK(PetscObjectTypeCompare((PetscObject)pc, PCGAMG, &is_mg));
  if (!is_mg) return 0;
  OK(PCMGGetLevels(pc, &levels));
  if (levels < 2) return 0;
  OK(PCMGGetSmoother(pc, levels - 1, &smoother));
  OK(KSPSetOperators(smoother, s->shell, s->a));
  OK(KSPChebyshevEstEigSet(smoother, PETSC_DECIDE, PETSC_DECIDE, PETSC_DECIDE, PETSC_DECIDE));
  OK(KSPSetUp(smoother));
  return (int)PCMGSetResidual(pc, levels - 1, PCMGResidualDefault, s->shell);
}

/* an option that is not typed already, in PETSC_OPTIONS or a file */
static int option(const char *name, const char *value) {
  PetscBool typed;
  OK(PetscOptionsHasName(NULL, NULL, name, &typed));
  return typed ? 0 : (int)PetscOptionsSetValue(NULL, name, value);
}

/* `xyz`: bs coordinates per own site, for the rigid motions that multigrid has to keep */
int bl_finish(Bl *s, const double *xyz, int direct, int symmetric) {
  Vec c;
  MatNullSpace null;
  PetscScalar *p;
  OK(MatAssemblyBegin(s->a, MAT_FINAL_ASSEMBLY));
  OK(MatAssemblyEnd(s->a, MAT_FINAL_ASSEMBLY));
  OK(MatCreateVecs(s->a, &s->x, &s->b));
  OK(KSPCreate(PETSC_COMM_WORLD, &s->ksp));
  OK(KSPSetOperators(s->ksp, s->shell ? s->shell : s->a, s->a));
  if (direct) {
    PC pc;
    OK(KSPSetType(s->ksp, KSPPREONLY));
    OK(KSPGetPC(s->ksp, &pc));
    OK(PCSetType(pc, symmetric ? PCCHOLESKY : PCLU));
    OK(PCFactorSetMatSolverType(pc, MATSOLVERMUMPS));
    OK(KSPSetUp(s->ksp)); /* options are for iterations */
    return 0;
  }
  OK(VecDuplicate(s->b, &c));
  OK(VecSetBlockSize(c, s->bs));
  OK(VecGetArray(c, &p));
  for (int i = 0; i < s->bs * s->mine; i++) p[i] = xyz[i];
  OK(VecRestoreArray(c, &p));
  OK(MatNullSpaceCreateRigidBody(c, &null));
  OK(MatSetNearNullSpace(s->a, null));
  OK(MatNullSpaceDestroy(&null));
  OK(VecDestroy(&c));
  OK(option("-pc_type", "gamg"));
  /* A smoother that suits seams: Chebyshev goes by real eigenvalues, and Gauss-Seidel fails where rows of coarse levels are empty. */
  OK(option("-mg_levels_ksp_type", symmetric ? "chebyshev" : "gmres"));
  OK(option("-mg_levels_ksp_max_it", symmetric ? "2" : "4"));
  OK(option("-mg_levels_pc_type", "jacobi"));
  OK(option("-mg_coarse_sub_pc_type", "lu"));
  if (!symmetric) OK(option("-pc_gamg_sym_graph", "true"));
  if (!symmetric) OK(option("-pc_gamg_symmetrize_graph", "true")); /* its name from PETSc 3.19 on */
  /* a smoother that iterates changes from call to call, which plain GMRES does not allow */
  OK(KSPSetType(s->ksp, symmetric ? KSPCG : KSPFGMRES));
  OK(KSPGMRESSetRestart(s->ksp, 100));
  OK(KSPSetFromOptions(s->ksp));
  OK(KSPSetUp(s->ksp));
  return s->shell ? smooth_by_product(s) : 0;
}

int bl_solve(Bl *s, const double *b, double *x, double tolerance, int most, int *iterations, const char **why) {
  PetscScalar *p;
  const PetscScalar *q;
  PetscInt n;
  KSPConvergedReason k;
  const char *told;
  OK(VecGetArray(s->b, &p));
  for (int i = 0; i < s->bs * s->mine; i++) p[i] = b[i];
  OK(VecRestoreArray(s->b, &p));
  OK(KSPSetTolerances(s->ksp, tolerance, PETSC_DEFAULT, PETSC_DEFAULT, most));
  OK(KSPSolve(s->ksp, s->b, s->x));
  OK(KSPGetIterationNumber(s->ksp, &n));
  OK(KSPGetConvergedReason(s->ksp, &k));
  OK(KSPGetConvergedReasonString(s->ksp, &told));
  OK(VecGetArrayRead(s->x, &q));
  for (int i = 0; i < s->bs * s->mine; i++) x[i] = q[i];
  OK(VecRestoreArrayRead(s->x, &q));
  *iterations = (int)n;
  *why = k < 0 ? told : NULL;
  return 0;
}
