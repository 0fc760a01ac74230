//! Texts below the list of commands and their options.

/// Examples of the commands.
pub const EXAMPLES: &str = "Examples:
  bondline new plate.toml                     write a commented scene to start from
  bondline check plate.toml                   say what is wrong with it, and how large it is
  bondline run plate.toml                     solve it and write out/plate.vtu for ParaView
  bondline run plate.toml --set coupling=splice --set peridynamics.horizon=0.04
  bondline run wave.toml --checkpoint-every 10min   a scene in time; Ctrl-C leaves a checkpoint
  bondline run wave.toml --resume             go on where it stopped
  bondline run plate.toml --json              the summary as JSON on standard output
  bondline trade plate.toml                   what speed costs in accuracy: method, horizon, spacing, zone
  bondline converge plate.toml --kind m       solve it on finer and finer lattices, and print orders
  bondline explain W32                        the cause of a warning, its number, and what helps
  bondline schema > bondline.schema.json      completion and checks in an editor";

/// Course of a trade, with examples.
pub const TRADE: &str = "The reference runs, then the scene as it is, then with each setting of each knob alone, then with the combinations that promise to be the cheapest of their coupling with the errors that are wanted. The tables compare couplings at equal error and at equal cost, and the chosen scene is written, ready to run.
Every outcome is kept in the output folder: the same command goes on where the last one ended.

Examples:
  bondline trade plate.toml                                  all knobs, ten minutes, what suits the outputs to 1 %
  bondline trade plate.toml --want probe:tip.u=1% --want line:cut.von_mises=3% --budget 2min
  bondline trade plate.toml --want 0.1% --knob coupling,m --reference fe
  bondline trade plate.toml --vary 'solver.tolerance=[1e-4, 1e-6]' --want displacement=1%,strain=1%
  bondline trade glass.toml --want path.upper=2%,tip-time.upper=2%";
